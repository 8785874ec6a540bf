//! MegaMol's MMPLD, version 1.2: one list of particles a frame.

use std::io::{self, SeekFrom};

use super::snapshot::Snapshot;
use super::{Out, Place, rows};

/// Bytes in front of the table of frames.
const HEADER_BYTES: u64 = 60;
/// Appends a frame; the first one makes room for the table of all frames.
pub(super) fn write(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    let start =
        if place.frame == 0 { HEADER_BYTES + 8 * (place.count as u64 + 1) } else { out.stream_position()? };
    // The box of all frames so far.
    out.seek(SeekFrom::Start(0))?;
    let mut head = b"MMPLD\0".to_vec();
    head.extend(102u16.to_le_bytes());
    head.extend((place.count as u32).to_le_bytes());
    for _ in ["the box", "the box to clip at"] {
        place.bounds.iter().flatten().for_each(|it| head.extend((*it as f32).to_le_bytes()));
    }
    if place.frame == 0 {
        head.resize(start as usize, 0);
    }
    out.write_all(&head)?;
    out.seek(SeekFrom::Start(start))?;
    let single = snapshot.fits_f32();
    if !single {
        place.note(
            "MMPLD: positions far from zero are written in double precision, for which it has no radii",
        );
    }
    let own_radii = single && snapshot.particles.radii().is_some() && snapshot.uniform_radius().is_none();
    let colors = snapshot.colors();
    let intensity = snapshot.attributes.iter().find(|it| it.components == 1 && !snapshot.is_radius(it));
    let left_out = snapshot.attributes.iter().any(|it| {
        !snapshot.is_radius(it) && (colors.is_some() || !intensity.is_some_and(|one| std::ptr::eq(*one, *it)))
    });
    if left_out {
        place.note("MMPLD holds one quantity beside the radius: a color, or else the first attribute (--fields NAME chooses)");
    }

    let mut head = Vec::new();
    head.extend((snapshot.particles.time().unwrap_or(place.frame as f64) as f32).to_le_bytes());
    head.extend(1u32.to_le_bytes());
    head.push(match (single, own_radii) {
        (true, true) => 2,
        (true, false) => 1,
        (false, _) => 4,
    });
    head.push(match (&colors, intensity) {
        (Some(_), _) => 4,
        (None, Some(_)) => 3,
        (None, None) => 0,
    });
    if !own_radii {
        head.extend(common_radius(snapshot, place.bounds).to_le_bytes());
    }
    match (&colors, intensity) {
        (Some(_), _) => {}
        (None, Some(attribute)) => {
            let values = (0..snapshot.len()).map(|id| attribute.number(id, 0) as f32);
            let range = values
                .fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], it| [low.min(it), high.max(it)]);
            let range = if range[0] <= range[1] { range } else { [0.0, 1.0] };
            range.iter().for_each(|it| head.extend(it.to_le_bytes()));
        }
        (None, None) => head.extend([192, 192, 192, 255]),
    }
    head.extend((snapshot.len() as u64).to_le_bytes());
    out.write_all(&head)?;
    rows::write_fixed(out, snapshot.len(), |bytes, id| {
        let position = snapshot.position(id);
        match single {
            true => position.as_vec3().to_array().into_iter().for_each(|it| bytes.extend(it.to_le_bytes())),
            false => position.to_array().into_iter().for_each(|it| bytes.extend(it.to_le_bytes())),
        }
        if own_radii {
            bytes.extend(snapshot.radius(id).unwrap_or_default().to_le_bytes());
        }
        match (&colors, intensity) {
            (Some(colors), _) => colors(id).into_iter().for_each(|it| bytes.extend(it.to_le_bytes())),
            (None, Some(attribute)) => bytes.extend((attribute.number(id, 0) as f32).to_le_bytes()),
            (None, None) => {}
        }
    })?;

    let end = out.stream_position()?;
    out.seek(SeekFrom::Start(HEADER_BYTES + 8 * place.frame as u64))?;
    out.write_all(&start.to_le_bytes())?;
    out.write_all(&end.to_le_bytes())?;
    out.seek(SeekFrom::Start(end))?;
    Ok(())
}

/// The radius of all: that of the first if each has its own, and half of the mean spacing if none has one.
fn common_radius(snapshot: &Snapshot, bounds: &[[f64; 3]; 2]) -> f32 {
    snapshot
        .uniform_radius()
        .or_else(|| (snapshot.len() > 0).then(|| snapshot.radius(0)).flatten())
        .unwrap_or_else(|| {
            let longest = (0..3).map(|axis| bounds[1][axis] - bounds[0][axis]).fold(0.0, f64::max);
            let spacing = longest / (snapshot.len().max(1) as f64).cbrt();
            if spacing > 0.0 { 0.5 * spacing as f32 } else { 1.0 }
        })
}
