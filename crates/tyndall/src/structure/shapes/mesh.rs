//! Meshes of triangles.

use glam::DVec3;

use crate::error::{Error, Result};

/// Triangles between corners: walls beside the particles.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    corners: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Triangles by the places of their corners, which lie in the space of the particles; `name` is what errors call it.
    ///
    /// Fails with [`Error::Setting`] if there are none, or more than 2^29, a corner is not finite, or a place is none of a corner.
    pub fn new(name: &str, corners: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self> {
        let wrong = |value: String, allowed: &str| Err(Error::setting(name, value, allowed));
        if triangles.is_empty() {
            return wrong("without faces".into(), "a mesh of one triangle or more");
        }
        if triangles.len() > 1 << 29 {
            return wrong(format!("of {} triangles", triangles.len()), "a mesh of 2^29 triangles or fewer");
        }
        for (number, triangle) in triangles.iter().enumerate() {
            for &place in triangle {
                match corners.get(place as usize) {
                    None => {
                        let text =
                            format!("with corner {place} in face {number}, of {} corners", corners.len());
                        return wrong(text, "corners that are there, counted from 0");
                    }
                    Some(corner) if !corner.is_finite() => {
                        return wrong(format!("with corner {place} at {corner}"), "corners at finite places");
                    }
                    Some(_) => {}
                }
            }
        }
        Ok(Self { corners, triangles })
    }

    /// How many triangles it has.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether it has none, which it never has.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// The corners of each triangle.
    pub fn triangles(&self) -> impl Iterator<Item = [DVec3; 3]> {
        self.triangles.iter().map(|places| places.map(|place| self.corners[place as usize]))
    }
}
