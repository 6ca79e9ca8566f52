//! `parhelion graph`.

use super::failure::{Failure, input};
use super::print::print;
use super::{args, scene};
use crate::graph::Typical;
use crate::output::{self, extension};
use crate::renderer;

pub(super) fn run(args: &args::Graph) -> Result<(), Failure> {
    let kind = args.output.as_deref().map(|file| (file, extension(file)));
    if let Some((file, kind)) = &kind {
        if !matches!(kind.as_deref(), Some("dot" | "json")) {
            return Err(input!("{}: a graph is written as .dot or .json", file.display()));
        }
        output::check_writable(file).map_err(Failure::input)?;
    }
    let config = args.settings.with(&[("--method", "method", args.method.clone())])?;
    let scene = scene::read(&args.file, false)?;
    let plan = renderer::plan(&scene, &config, &[], &Typical)?;
    match kind {
        None => print(&plan.dot(&[])),
        Some((file, kind)) => {
            let text = match kind.as_deref() {
                Some("json") => format!("{:#}\n", plan.json(&[])),
                _ => plan.dot(&[]),
            };
            Ok(output::write_file(file, |out| out.write_all(text.as_bytes()))?)
        }
    }
}
