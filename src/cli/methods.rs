//! `parhelion methods`.

use super::args::Methods;
use super::failure::{Failure, input};
use crate::docs::Measurements;
use crate::output::{self, extension};
use std::ffi::OsStr;
use std::fs;

pub(super) fn run(args: &Methods) -> Result<(), Failure> {
    let file = &args.output;
    let folder = file.with_extension("");
    let stem = folder.file_name().and_then(OsStr::to_str);
    let Some(stem) = stem.filter(|_| extension(file).as_deref() == Some("md")) else {
        return Err(input!("{}: the page is written as .md", file.display()));
    };
    output::check_writable(file).map_err(Failure::input)?;
    if folder.exists() && !folder.is_dir() {
        return Err(input!("{}: a file; the page's pictures go to a folder of this name", folder.display()));
    }
    let page = Measurements::read(&args.chart, args.stress.as_deref())?.page(stem)?;
    if folder.is_dir() {
        for (name, _) in &page.files {
            output::check_writable(&folder.join(name)).map_err(Failure::input)?;
        }
    } else {
        fs::create_dir(&folder).map_err(|source| output::Error { file: folder.clone(), source })?;
    }
    for (name, bytes) in &page.files {
        output::write_file(&folder.join(name), |out| out.write_all(bytes))?;
    }
    Ok(output::write_file(file, |out| out.write_all(page.text.as_bytes()))?)
}
