//! stub
/// stub
pub struct ParticleColors;
impl ParticleColors { pub fn constant(_c: [f32;3]) -> Self { Self } }
impl ParticleColors {
    /// stub
    pub fn color(&self, _id: usize) -> [f32; 3] { [0.8, 0.5, 0.3] }
}
