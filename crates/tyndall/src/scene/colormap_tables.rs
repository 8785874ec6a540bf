//! Color maps as data: what `colormap` reads.
//!
//! Source: the 256 levels of `matplotlib.colormaps` 3.11 (matplotlib's BSD-style licence; the ColorBrewer maps are Cynthia
//! Brewer's, Apache-2.0; turbo is Anton Mikhailov's, Apache-2.0). Each map is the shortest list of knots whose straight lines
//! stay within 1/255 of those levels.

/// Maps by knots: name, and words `LLRRGGBB` of the level (0 to 255) and the sRGB color there.
#[rustfmt::skip]
pub(super) const KNOTS: [(&str, &str); 60] = [
    ("cividis",
     "0000224e 0e002c66 14003070 17013271 1c123570 25233c6e 3538476c 56585e6d 77757575 807d7c78 98938e78 \
      b7b3a670 d3d0be62 e6e5cf52 f4f5dc41 fbfde334 fffee838"),
    ("turbo",
     "0030123b 08392a73 0e3f3b97 164451bf 1d4664da 244776ee 2b4687fb 314196ff 3738a5fb 3e2cb7f0 481ccdd8 \
      4e18d9c8 5419e3b9 5a22ebaa 6238f491 6e65fd69 7788ff4e 7d9cfe40 85b1f936 8dc6f034 96dbe236 a0eecf3a \
      a7f7c13a affdae35 b8fe962b c4f8721c ceed5510 d5e4450a dfd23105 e9bc2002 f59b0f01 fe7e0502 ff7a0403"),
    ("Greys",
     "00ffffff 26ececec 47d3d3d3 60bdbdbd 80959595 be535353 c44b4b4b e41f1f1f ff000000"),
    ("Purples",
     "00fcfbfd 23edebf4 42d8d8ea 60bcbddc 819d99c7 9f807dba d05e3b98 ec4c1788 ff3f007d"),
    ("Blues",
     "00f7fbff 3ec7dcef 44c1d9ed 619cc9e1 8169add5 a23f8fc5 c02070b4 e008509b ff08306b"),
    ("Greens",
     "00f7fcf5 21e4f5df 41c6e8bf 629ed798 8270c274 9f42ab5d d1107a37 df006d2c ff00441b"),
    ("Oranges",
     "00fff5eb 20fee6ce 41fdcfa0 62fdac67 83fc8937 9ff16913 bfd94801 e2a23503 ff7f2704"),
    ("Reds",
     "00fff5f0 20fee0d2 47fcb296 62fc8f6f 80fb694a 9fef3c2c bfcb181d dfa50f15 ff67000d"),
    ("YlOrBr",
     "00ffffe5 22fff6b9 40fee390 5ffec550 80fe9829 a0eb6f14 c0cb4b02 e3933204 ff662506"),
    ("YlOrRd",
     "00ffffcc 32fee288 40fed976 60feb24c 80fd8c3c a1fb4b29 c0e2191c dfbd0026 ff800026"),
    ("OrRd",
     "00fff7ec 23fee6c4 41fdd39d 5ffdbb85 6bfdab75 80fc8c59 a0ef6447 c1d52d1d dfb30000 ff7f0000"),
    ("PuRd",
     "00f7f4f9 21e6e0ee 42d3b6d9 60c993c7 80df64af 9fe72a8a bfce1256 e0970042 ff67001f"),
    ("RdPu",
     "00fff7f3 22fddedb 40fcc5c0 61fa9db4 80f767a1 a1db3196 bfae017e e5710175 ff49006a"),
    ("BuPu",
     "00f7fcfd 1fe1ecf4 5f9fbcda 659bb6d7 808c95c6 ab8b5caa c1883e9b df810f7c ff4d004b"),
    ("GnBu",
     "00f7fcf0 2cd8f0d3 41cbeac4 60a7ddb5 8277cac5 a04db2d3 c92081b8 df0868ac ff084081"),
    ("PuBu",
     "00fff7fb 21ebe6f2 40d0d1e6 659ebad9 8171a8ce a0358fc0 bf0570b0 e004598c ff023858"),
    ("YlGnBu",
     "00ffffd9 20edf8b1 40c6e9b4 607ecdbb 8040b5c4 9f1d91c0 c2225aa6 df253494 ff081d58"),
    ("PuBuGn",
     "00fff7fb 21ebe1f0 40d0d1e6 60a5bddb 8263a7ce a03590bf bf02818a e1016a57 ff014636"),
    ("BuGn",
     "00f7fcfd 20e5f5f9 40ccece6 6098d8c9 8065c2a3 a13fac74 c0228a44 df006d2c ff00441b"),
    ("YlGn",
     "00ffffe5 21f6fcb8 40d9f0a3 62a9db8c 8372c376 a040aa5c c1218242 df006837 ff004529"),
    ("PiYG",
     "008e0152 19c41a7c 25d04493 33de77ae 4cf1b5d9 66fde0ef 7ff7f7f7 99e6f5d0 b3b7e085 cc7fbc41 e64c9121 \
      ff276419"),
    ("PRGn",
     "0040004b 1a772b84 339970ab 4dc3a6cf 66e7d4e8 7ff7f6f7 84f2f6f1 99d9f0d3 b3a5da9f cd58ac5f e61a7736 \
      ff00441b"),
    ("BrBG",
     "00543005 198b500a 31bb7d2a 34c08430 4ddfc37e 66f6e8c3 80f4f5f5 99c7eae5 b281cec2 cd33958d e601655d \
      ff003c30"),
    ("PuOr",
     "007f3b08 1ab45906 33e08214 4dfdb965 67fee1b9 7ff7f7f6 82f4f4f6 99d8daeb b4afa8d0 cc8073ac e6532687 \
      ff2d004b"),
    ("RdGy",
     "0067001f 1ab3192c 34d7634f 4df4a683 66fddbc7 7ffffefe 88f5f5f5 9ed9d9d9 b4b7b7b7 d07e7e7e e8484848 \
      ff1a1a1a"),
    ("RdBu",
     "0067001f 1ab3192c 34d7634f 4df4a683 66fddbc7 7ff7f6f6 81f5f6f7 99d1e5f0 b390c4dd cc4393c3 e62065ab \
      ff053061"),
    ("RdYlBu",
     "00a50026 1ad83128 33f46d43 4dfdaf62 67fee192 80feffc0 99e0f3f8 b3aad8e9 ce70a9cf e54676b5 ff313695"),
    ("RdYlGn",
     "00a50026 1ad83128 33f46d43 4dfdaf62 67fee18d 7ffffebe 80feffbe 9bd5ed88 b2a7d96b cd63bc62 e6199750 \
      ff006837"),
    ("Spectral",
     "009e0142 1ad63f4f 33f46d43 4dfdaf62 67fee18d 7ffffebe 83fcfeba 99e6f598 b4a7dba4 cc66c2a5 e53389bd \
      e83682ba ff5e4fa2"),
    ("coolwarm",
     "003b4cc0 104e68d8 226485ec 337b9ff9 4594b6ff 53a7c5fe 62bbd1f8 72cedaeb 7fdcdddd 91edd2c3 a0f5c4ac \
      aef7b396 baf6a283 ccee8468 dedf634e efcb3e38 f7c0282f ffb40426"),
    ("bwr",
     "000000ff 7ffefeff 81fffcfc ffff0000"),
    ("seismic",
     "0000004c 400101ff 7ffdfdff 80fffdfd bfff0101 ff800000"),
    ("twilight",
     "00e2d9e2 06dad8df 0dcbd2d7 1ba1bdc9 2587abc4 307196c1 396684bd 456069b7 515e4dab 5b5c359a 62572588 \
      68511a75 71421257 77391146 7d32123a 80301437 86381139 8f4a1342 9c6c1b4e a6852650 af983550 b8a84750 \
      c2b65d54 cdc1775f d8c89275 e5d0b29c f2dbccc8 f8dfd5d8 fee2d9e1 ffe2d9e2"),
    ("twilight_shifted",
     "00301437 0434113e 0a3c114b 12491564 18521c79 1f59298e 275d3ca0 325f57b0 3e6172ba 49698abf 53789ec2 \
      5d8eb1c5 69b0c5cd 74d0d4d9 79dad8df 7fe2d9e2 85e0d6da 8bdccecb 97d1b6a3 a1cb9f83 a9c68b6e b1c1775f \
      bdb55b53 c6a84750 d0963350 d8852650 e26c1b4e ef4a1342 f8381139 ff2f1436"),
    ("hsv",
     "00ff0000 28ffec00 2cf8fd00 2eeeff00 5508ff00 5900ff10 8100fffc 8200fcff aa0010ff ae0800ff d6f400ff \
      d8fa00f9 dbff00ed ffff0018"),
    ("binary",
     "00ffffff ff000000"),
    ("gray",
     "00000000 ffffffff"),
    ("bone",
     "00000000 5d515171 bfa7c7c7 ffffffff"),
    ("pink",
     "001e0000 04321a1a 08402525 11573636 1e714747 36956060 50b47575 5cc17d7d 75cc9f8d 8dd6ba9b b4e5e0af \
      bfe9e9b5 dcf3f3da fefffffe ffffffff"),
    ("hot",
     "000b0000 5dff0000 befffe00 d9ffff69 ffffffff"),
    ("afmhot",
     "00000000 40800000 80ff8001 bffffe7f ffffffff"),
    ("gist_heat",
     "00000000 80c00100 aaff5500 bfff7f00 ffffffff"),
    ("copper",
     "00000000 cefea166 ffffc77f"),
    ("cool",
     "0000ffff ffff00ff"),
    ("spring",
     "00ff00ff ffffff00"),
    ("summer",
     "00008066 ffffff66"),
    ("autumn",
     "00ff0000 ffffff00"),
    ("winter",
     "000000ff ff00ff80"),
    ("Wistia",
     "00e4ff7a 41ffe719 80ffbd00 cdfe9900 fffc7f00"),
    ("jet",
     "00000080 1c0000ff 200000ff 5700dcfe 5900e4f8 5e0ff8e7 6016ffe1 a3eeff09 a6f8f500 a8feed00 e3ff1300 \
      e8e80000 ff800000"),
    ("rainbow",
     "008000ff 165444fd 283079f7 3711a0f1 4000b5eb 5020d5e1 5f3febd5 6c58f8c9 7b76ffb9 8890feab 95abf69b \
      a1c2ea8c b0e0d377 bffeb562 d0ff8c49 e2ff592d fbff0d06 ffff0000"),
    ("gist_rainbow",
     "00ff0029 07ff0003 08ff0200 36fffb00 37feff00 6600ff00 9500fffd 9600fcff c40002ff c60900ff f3fe00ff \
      f7ff00eb ffff00bf"),
    ("nipy_spectral",
     "00000000 0c700080 0d770088 19870098 1a83009a 260300aa 270000ad 330000dd 3f0070dd 400078dd 4c0098dd \
      4e009bd7 5900aaab 6600aa88 72009a08 73009a00 9900ff00 a5b0ff00 a6bcff00 b3efed00 bfffcd00 ccff9900 \
      d8ff0900 d9fe0000 e6dc0000 f2cc0000 f3cc0c0c ffcccccc"),
    ("gnuplot",
     "00000000 01100006 031c0013 072a002c 0f3e005c 174d0089 205a01b5 286501d5 306f02ec 367502f8 3e7e04ff \
      448405fe 4a8906f7 508f08eb 58960ad3 609c0eb3 6aa41281 72aa1753 7db31e10 7fb42003 80b52000 94c23200 \
      a6ce4600 b9d96100 cee58600 e1f0af00 f4f9df00 ffffff00"),
    ("gnuplot2",
     "00000000 400100ff 6b8700ff 91fe4cb3 eafffe01 ebffff05 ffffffff"),
    ("CMRmap",
     "00000000 20262680 404d26bf 609a337e 7ffd4028 80ff4126 9fe67f00 bfe6bf19 e0e6e683 ffffffff"),
    ("brg",
     "000000ff 7ffe0001 81fc0300 ff00ff00"),
    ("gist_earth",
     "00000000 0101002b 02010039 0705006e 08050274 21163b79 3624647c 48308080 75459a49 774a9b46 8b76a652 \
      b2b7b75e c8c0a465 ccc4a46f ddd7b298 e6e1bfb0 f5f2dedd fffdfbfb"),
    ("terrain",
     "00333399 260098fe 29009eef 3f00cb6b 4001cc66 7ffdff99 80fefe98 bf805c54 d5ab938e ffffffff"),
    ("ocean",
     "00008000 55000055 aa0080aa ffffffff"),
];

/// Lists of distinct colors: name, and words `RRGGBB`. Sources beside matplotlib, all for color-blind people too: M. Okabe and K. Ito,
/// Color Universal Design, 2008; M. Petroff, Accessible Color Sequences for Data Visualization, 2021; P. Tol, Colour Schemes, 2021.
#[rustfmt::skip]
pub(super) const LISTS: [(&str, &str); 7] = [
    ("tab20",
     "1f77b4 aec7e8 ff7f0e ffbb78 2ca02c 98df8a d62728 ff9896 9467bd c5b0d5 8c564b c49c94 e377c2 f7b6d2 \
      7f7f7f c7c7c7 bcbd22 dbdb8d 17becf 9edae5"),
    ("tab20b",
     "393b79 5254a3 6b6ecf 9c9ede 637939 8ca252 b5cf6b cedb9c 8c6d31 bd9e39 e7ba52 e7cb94 843c39 ad494a \
      d6616b e7969c 7b4173 a55194 ce6dbd de9ed6"),
    ("tab20c",
     "3182bd 6baed6 9ecae1 c6dbef e6550d fd8d3c fdae6b fdd0a2 31a354 74c476 a1d99b c7e9c0 756bb1 9e9ac8 \
      bcbddc dadaeb 636363 969696 bdbdbd d9d9d9"),
    ("okabe_ito",
     "e69f00 56b4e9 009e73 f0e442 0072b2 d55e00 cc79a7 000000"),
    ("petroff10",
     "3f90da ffa90e bd1f01 94a4a2 832db6 a96b59 e76300 b9ac70 717581 92dadd"),
    ("tol_bright",
     "4477aa ee6677 228833 ccbb44 66ccee aa3377 bbbbbb"),
    ("tol_muted",
     "cc6677 332288 ddcc77 117733 88ccee 882255 44aa99 999933 aa4499 dddddd"),
];
