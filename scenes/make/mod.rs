//! The project's own rooms, built from measurements and shapes.

mod conference;
mod cornell;
mod figure;
mod furniture;
mod glb;
mod office;
mod shape;
mod shell;

/// File names under `scenes/` and their contents.
pub(crate) fn files() -> [(&'static str, Vec<u8>); 6] {
    [
        ("cornell.glb", cornell::cornell()),
        ("office.glb", office::office()),
        ("conference.glb", conference::conference()),
        ("cornell-moving.glb", cornell::moving()),
        ("office-moving.glb", office::moving()),
        ("conference-walk.glb", conference::walk()),
    ]
}
