//! What a part of a picture shows at places finer than its pixels: a ray each, in the middle of the place.

use crate::error::Result;
use crate::film::Window;
use crate::render::cpu::seen::{Touched, touched};
use crate::render::{Renderer, Settings};
use crate::scene::Scene;
use crate::scene::camera::{Camera, View};

/// See the module. Places are counted row by row.
pub(super) struct Fine<'a> {
    scene: &'a Scene,
    view: View,
    window: Window,
    /// As in [`crate::film::Image::depth`].
    pub(super) depth: Vec<f32>,
    pub(super) node: Vec<u32>,
}

impl<'a> Fine<'a> {
    /// The places in `window` of a picture that has one in each pixel. Fails as [`Renderer::of_window`] does.
    pub(super) fn of(
        (scene, camera): (&'a Scene, &Camera),
        settings: &Settings,
        window: Window,
    ) -> Result<Self> {
        let view = camera.view(scene.structure().origin(), settings.width, settings.height)?;
        let mut renderer = Renderer::of_window(scene, camera, settings, window)?.unlit();
        renderer.finish(&())?;
        let (depth, node) = renderer.met();
        Ok(Self { scene, view, window, depth, node })
    }

    /// Places in a row.
    pub(super) fn width(&self) -> usize {
        self.window.width as usize
    }

    /// The places of a pixel of the picture, `places` x `places` of them, and those that lie up to `around` places away.
    pub(super) fn places_of(
        &self,
        [x, y]: [u32; 2],
        places: u32,
        around: u32,
    ) -> impl Iterator<Item = usize> + use<> {
        let Window { x: left, y: top, width, height } = self.window;
        let range = |at: u32, start: u32, length: u32| {
            let first = (at * places - start) as usize;
            let around = around as usize;
            first.saturating_sub(around)..(first + places as usize + around).min(length as usize)
        };
        let (columns, width) = (range(x, left, width), width as usize);
        range(y, top, height).flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }

    /// How long a place's edge is at that depth.
    pub(super) fn edge_at(&self, depth: f32) -> f32 {
        self.view.pixel * if self.view.perspective { depth } else { 1.0 }
    }

    /// The depth at which a ray would graze what a place shows: that of its silhouette, as near as it may be.
    pub(super) fn silhouette(&self, place: usize) -> f32 {
        let Touched { point, normal, radius, .. } = self.touched(place);
        let offset = point - radius * normal - self.view.eye;
        let grazed = match self.view.perspective {
            true => (offset.length_squared() - radius * radius).max(0.0).sqrt(),
            false => offset.dot(self.view.forward),
        };
        grazed.max(self.depth[place])
    }

    /// The surface that a place shows.
    pub(super) fn touched(&self, place: usize) -> Touched {
        let [column, row] = [place % self.width(), place / self.width()].map(|it| it as f32 + 0.5);
        let ray = self.view.ray(self.window.x as f32 + column, self.window.y as f32 + row);
        let point = ray.origin + self.depth[place] * ray.direction;
        touched(self.scene, self.node[place], point, ray.direction)
    }
}
