//! Anisotropic displacement parameters: the records ANISOU, as an attribute `U` of six numbers, U11 U22 U33 U12 U13 U23 in Å².

use tyndall::particles::{Attribute, Values};

use super::{field, lines, numbers};

/// Numbers of a record are ten thousandths of Å².
const UNIT: f32 = 1e-4;

/// The parameters of the atoms at these places by their serial numbers; atoms without a record have NaN. None without any record.
pub(super) fn displacements(text: &[u8], serials: &[[u8; 5]]) -> Option<Attribute> {
    let first = memchr::memmem::find(text, b"\nANISOU")? + 1;
    let places = numbers::places(serials);
    let mut values = vec![f32::NAN; 6 * serials.len()];
    for (_, line) in lines(&text[first..]).filter(|(_, line)| line.starts_with(b"ANISOU")) {
        let place = places.get(field(line, 7, 11)).copied().flatten();
        let number = |at: usize| fast_float2::parse::<f32, _>(field(line, at, at + 6)).ok();
        let numbers = [29, 36, 43, 50, 57, 64].map(number);
        if let Some(place) = place.filter(|_| numbers.iter().all(Option::is_some)) {
            let own = &mut values[6 * place as usize..][..6];
            own.iter_mut().zip(numbers.into_iter().flatten()).for_each(|(own, number)| *own = UNIT * number);
        }
    }
    let mut attribute = Attribute::new("U", 6, Values::F32(values));
    attribute.unit = Some("Å²".into());
    Some(attribute)
}
