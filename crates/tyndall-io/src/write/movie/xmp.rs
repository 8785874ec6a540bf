//! Keys and texts as XMP, which MP4 and WebP have a place for.
//!
//! Source: Adobe, XMP Specification Part 1 (2012), section 7, and Part 3, on MPEG-4 and WebP.

/// The type of the `uuid` box of an MP4 that has XMP.
pub(super) const UUID: [u8; 16] =
    [0xbe, 0x7a, 0xcf, 0xcb, 0x97, 0xa9, 0x42, 0xe8, 0x9c, 0x71, 0x99, 0x94, 0x91, 0xe3, 0xaf, 0xac];

/// A packet: all keys and texts as the description, a key a line, and the program's name.
pub(super) fn packet(metadata: &[(String, String)]) -> String {
    let lines: Vec<String> = metadata.iter().map(|(key, text)| format!("{key}: {text}")).collect();
    let description = escaped(&lines.join("\n"));
    let software = metadata.iter().find(|(key, _)| key == "Software").map_or("Tyndall", |(_, text)| text);
    let software = escaped(software);
    format!(
        r#"<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description rdf:about="" xmlns:xmp="http://ns.adobe.com/xap/1.0/" xmlns:dc="http://purl.org/dc/elements/1.1/">
<xmp:CreatorTool>{software}</xmp:CreatorTool>
<dc:description><rdf:Alt><rdf:li xml:lang="x-default">{description}</rdf:li></rdf:Alt></dc:description>
</rdf:Description></rdf:RDF></x:xmpmeta>
<?xpacket end="w"?>"#
    )
}

/// Text of XML, without the signs that XML cannot have.
fn escaped(text: &str) -> String {
    let allowed: String =
        text.chars().filter(|sign| !sign.is_control() || matches!(sign, '\n' | '\t')).collect();
    quick_xml::escape::escape(&allowed).into_owned()
}
