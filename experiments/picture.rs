//! Writes pictures for reports: crops of tone-mapped images, and maps in false colours.

use std::path::Path;

use prpf::image::{Planes, png_file, tone};

/// The colour map `viridis`, from dark blue to yellow, at equal distances.
const COLOURS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

/// Crops an image to x0, x1, y0, y1, half open, inside the image.
pub fn crop(planes: &Planes, [x0, x1, y0, y1]: [usize; 4]) -> Planes {
    let mut out = Planes::new(x1 - x0, y1 - y0, planes.count());
    for k in 0..planes.count() {
        let rows = out.plane_mut(k).chunks_mut(x1 - x0).zip(y0..y1);
        rows.for_each(|(row, y)| row.copy_from_slice(&planes.row(k, y)[x0..x1]));
    }
    out
}

/// Joins pictures of one height and plane count in a row, with gaps between them.
pub fn in_a_row(pictures: &[Planes]) -> Planes {
    const GAP: usize = 4;
    let height = pictures.iter().map(Planes::height).min().unwrap_or(0);
    let width = pictures.iter().map(|p| p.width() + GAP).sum::<usize>().saturating_sub(GAP);
    let mut out = Planes::new(width, height, pictures.first().map_or(0, Planes::count));
    out.data_mut().fill(1.0);
    let mut x = 0;
    for picture in pictures {
        for k in 0..out.count() {
            for y in 0..height {
                out.plane_mut(k)[y * width + x..][..picture.width()].copy_from_slice(picture.row(k, y));
            }
        }
        x += picture.width() + GAP;
    }
    out
}

/// Writes an image as PNG. `exposure` is in stops.
///
/// # Errors
/// A file that cannot be written.
pub fn write(path: &Path, planes: &Planes, exposure: f32) -> anyhow::Result<()> {
    Ok(png_file::write(path, planes, exposure)?)
}

/// Writes the first plane as PNG in false colours, from 0 (dark) to `max` (yellow).
///
/// # Errors
/// A file that cannot be written.
pub fn write_map(path: &Path, planes: &Planes, max: f32) -> anyhow::Result<()> {
    let bytes: Vec<u8> = planes.plane(0).iter().flat_map(|&value| colour(value / max)).collect();
    Ok(png_file::write_srgb8(path, planes.width(), planes.height(), &bytes)?)
}

/// Converts the first plane to an image in the same false colours: 3 planes of linear light.
pub fn false_colour(planes: &Planes, max: f32) -> Planes {
    let mut image = Planes::new(planes.width(), planes.height(), 3);
    for (i, &value) in planes.plane(0).iter().enumerate() {
        for (c, byte) in colour(value / max).into_iter().enumerate() {
            image.plane_mut(c)[i] = tone::srgb_decode(f32::from(byte) / 255.0);
        }
    }
    image
}

/// The colour of a value in [0, 1]; grey for NaN.
fn colour(value: f32) -> [u8; 3] {
    if value.is_nan() {
        return [128; 3];
    }
    let position = value.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f32;
    let i = (position as usize).min(COLOURS.len() - 2);
    let t = position - i as f32;
    std::array::from_fn(|c| {
        let (a, b) = (f32::from(COLOURS[i][c]), f32::from(COLOURS[i + 1][c]));
        (a + t * (b - a)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered(width: usize, height: usize) -> Planes {
        let mut planes = Planes::new(width, height, 1);
        planes.data_mut().iter_mut().enumerate().for_each(|(i, value)| *value = i as f32);
        planes
    }

    #[test]
    fn a_crop_has_the_pixels_of_its_bounds() {
        assert_eq!(crop(&numbered(4, 3), [1, 3, 1, 3]).data(), [5.0, 6.0, 9.0, 10.0]);
    }

    #[test]
    fn a_row_shows_pictures_side_by_side() {
        let row = in_a_row(&[numbered(2, 2), numbered(1, 2)]);
        assert_eq!((row.width(), row.height()), (7, 2));
        assert_eq!(row.row(0, 1), [2.0, 3.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn false_colours_are_clamped_to_the_map() {
        assert_eq!(colour(0.0), COLOURS[0]);
        assert_eq!(colour(0.5), COLOURS[4]);
        assert_eq!([colour(1.0), colour(7.0)], [COLOURS[8]; 2]);
        assert_eq!(colour(f32::NAN), [128; 3]);
    }
}
