//! Writes the scenes that come with the project: `cargo run --example make_scenes`.

#[path = "mod.rs"]
mod make;

fn main() -> std::io::Result<()> {
    for (name, bytes) in make::files() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        std::fs::write(&path, &bytes)?;
        println!("{}: {} bytes", path.display(), bytes.len());
    }
    Ok(())
}
