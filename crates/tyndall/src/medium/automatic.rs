//! What is guessed about a medium where nobody says: its extinction, so that the picture is neither fog nor void.

use rayon::prelude::*;

use super::Grid;

/// Optical thickness that the median column gets: smoke with lit edges and a body that hides what is behind.
pub const THICKNESS: f32 = 6.0;
/// Columns with less than this share of the thickest one do not count.
const FAINT: f32 = 0.02;

/// The extinction of density 1 for which the median column along the axes is `thickness` thick; 0 without density.
pub fn extinction(density: &Grid, thickness: f32) -> f32 {
    let [width, height, depth] = density.size().map(|it| it as usize);
    let planes: Vec<Columns> = (0..depth)
        .into_par_iter()
        .map(|k| {
            let mut columns =
                Columns { x: vec![0.0; height], y: vec![0.0; width], plane: vec![0.0; width * height] };
            for j in 0..height {
                for i in 0..width {
                    let value = density.value(i as u32, j as u32, k as u32);
                    columns.x[j] += value;
                    columns.y[i] += value;
                    columns.plane[j * width + i] = value;
                }
            }
            columns
        })
        .collect();
    let mut along_z = vec![0.0; width * height];
    for columns in &planes {
        along_z.iter_mut().zip(&columns.plane).for_each(|(sum, value)| *sum += value);
    }
    let mut sums: Vec<f32> = planes.into_iter().flat_map(|it| it.x.into_iter().chain(it.y)).collect();
    sums.append(&mut along_z);

    let thickest = sums.iter().fold(0.0_f32, |most, &it| most.max(it));
    sums.retain(|&it| it > FAINT * thickest);
    if sums.is_empty() {
        return 0.0;
    }
    let middle = sums.len() / 2;
    let (_, median, _) = sums.select_nth_unstable_by(middle, f32::total_cmp);
    let extinction = thickness / (*median * density.spacing());
    if extinction.is_finite() { extinction } else { 0.0 }
}

/// Sums over one plane of samples.
struct Columns {
    x: Vec<f32>,
    y: Vec<f32>,
    plane: Vec<f32>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn a_block_gets_the_thickness_that_is_asked_for() {
        let block = Grid::from_dense(Vec3::ZERO, 0.5, [8; 3], &[3.0; 512]).unwrap();
        assert!((extinction(&block, 6.0) * 3.0 * 8.0 * 0.5 - 6.0).abs() < 1e-4);
    }

    #[test]
    fn nothing_needs_no_extinction() {
        let empty = Grid::from_dense(Vec3::ZERO, 0.5, [4; 3], &[0.0; 64]).unwrap();
        assert_eq!(extinction(&empty, 6.0), 0.0);
    }
}
