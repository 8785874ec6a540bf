//! How long work tells its caller how far it is, and is told to stop.

/// Listens to long work. Called from many threads, at most a few hundred times a second.
pub trait Progress: Sync {
    /// A new stage begins: its name ("open", "read", "build", "render") and how much there is to do, in `unit` ("B", "particles",
    /// "samples"); `None` if that is not known.
    fn begin(&self, stage: &str, total: Option<u64>, unit: &'static str);
    /// `amount` more of the current stage is done.
    fn advance(&self, amount: u64);
    /// Whether the work should end with [`crate::Error::Interrupted`] as soon as it can.
    fn cancelled(&self) -> bool;
    /// `bytes`, from which the work reads, are not looked at again: who keeps them in memory may give them up. Nothing unless said otherwise.
    fn let_go(&self, _bytes: &[u8]) {}
}

/// Nobody listens, nobody stops.
impl Progress for () {
    fn begin(&self, _stage: &str, _total: Option<u64>, _unit: &'static str) {}
    fn advance(&self, _amount: u64) {}
    fn cancelled(&self) -> bool {
        false
    }
}
