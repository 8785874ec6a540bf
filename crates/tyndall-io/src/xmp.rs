//! Keys and texts as XMP, which JPEG, MP4 and WebP have a place for: all together as a description, which programs show, and each as an
//! element of Tyndall's own, so that it can be read back.
//!
//! Source: Adobe, XMP Specification Part 1 (2012), section 7, and Part 3, on JPEG, MPEG-4 and WebP.

use quick_xml::events::Event;

/// The type of the `uuid` box of an MP4 that has XMP.
pub(crate) const UUID: [u8; 16] =
    [0xbe, 0x7a, 0xcf, 0xcb, 0x97, 0xa9, 0x42, 0xe8, 0x9c, 0x71, 0x99, 0x94, 0x91, 0xe3, 0xaf, 0xac];

/// What begins the application segment of a JPEG that has XMP.
pub(crate) const IN_JPEG: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";
/// How names of Tyndall's own begin.
const PREFIX: &str = "tyndall:";

/// A packet: all keys and texts as the description, a key a line, and the program's name.
pub(crate) fn packet(metadata: &[(String, String)]) -> String {
    let lines: Vec<String> = metadata.iter().map(|(key, text)| format!("{key}: {text}")).collect();
    let description = escaped(&lines.join("\n"));
    let software = metadata.iter().find(|(key, _)| key == "Software").map_or("Tyndall", |(_, text)| text);
    let software = escaped(software);
    let is_name = |key: &str| key.chars().all(|letter| letter.is_ascii_alphabetic()) && !key.is_empty();
    let elements = metadata.iter().filter(|(key, _)| is_name(key));
    let elements: String =
        elements.map(|(key, text)| format!("<{PREFIX}{key}>{}</{PREFIX}{key}>\n", escaped(text))).collect();
    format!(
        r#"<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description rdf:about="" xmlns:xmp="http://ns.adobe.com/xap/1.0/" xmlns:dc="http://purl.org/dc/elements/1.1/" xmlns:tyndall="urn:tyndall:1">
<xmp:CreatorTool>{software}</xmp:CreatorTool>
<dc:description><rdf:Alt><rdf:li xml:lang="x-default">{description}</rdf:li></rdf:Alt></dc:description>
{elements}</rdf:Description></rdf:RDF></x:xmpmeta>
<?xpacket end="w"?>"#
    )
}

/// Text of XML, without the signs that XML cannot have.
fn escaped(text: &str) -> String {
    let allowed: String =
        text.chars().filter(|sign| !sign.is_control() || matches!(sign, '\n' | '\t')).collect();
    quick_xml::escape::escape(&allowed).into_owned()
}

/// The elements of Tyndall's own in a packet; else what is wrong with it.
pub(crate) fn texts(packet: &str) -> Result<Vec<(String, String)>, String> {
    let mut reader = quick_xml::Reader::from_str(packet);
    let mut texts: Vec<(String, String)> = Vec::new();
    let mut is_inside = false;
    loop {
        match reader.read_event().map_err(|error| error.to_string())? {
            Event::Start(start) => {
                let key = start.name().as_ref().strip_prefix(PREFIX).map(String::from);
                is_inside = key.is_some();
                texts.extend(key.map(|key| (key, String::new())));
            }
            Event::End(_) => is_inside = false,
            Event::Text(part) if is_inside => push(&mut texts, &part.into_inner()),
            Event::GeneralRef(name) if is_inside => {
                let reference = format!("&{};", name.into_inner());
                let sign = quick_xml::escape::unescape(&reference).map_err(|error| error.to_string())?;
                push(&mut texts, &sign);
            }
            Event::Eof => return Ok(texts),
            _ => {}
        }
    }
}

fn push(texts: &mut [(String, String)], part: &str) {
    texts.last_mut().into_iter().for_each(|(_, text)| text.push_str(part));
}
