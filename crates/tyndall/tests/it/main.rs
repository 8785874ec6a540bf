//! Tests through the front door.

mod closed_form;
mod layers;
