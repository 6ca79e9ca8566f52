//! The project's own rooms, built from measurements and shapes.

mod conference;
mod cornell;
mod furniture;
mod glb;
mod office;
mod shape;
mod shell;

/// File names under `scenes/` and their contents.
pub(crate) fn files() -> [(&'static str, Vec<u8>); 3] {
    [
        ("cornell.glb", cornell::cornell()),
        ("office.glb", office::office()),
        ("conference.glb", conference::conference()),
    ]
}
