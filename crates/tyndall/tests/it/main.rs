//! Tests through the front door.

#![allow(clippy::unwrap_used, reason = "a test that panics fails")]

mod closed_form;
mod layers;
