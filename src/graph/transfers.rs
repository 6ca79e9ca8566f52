//! Recording of copies, and of what the host gives and gets.

use super::{
    error::{Error, Mistake, quoted, suggestion},
    record::{Graph, SCENE},
    resource::{AnyRes, Buffer, Desc, Image, Res, Tap, Ticket},
    stages::Stages,
    work::{PassDecl, Use, Work},
};
use crate::vk::Access;
use bytemuck::Pod;
use std::borrow::Cow;

impl Graph {
    /// Sets every four bytes of a buffer, whose size must be a multiple of 4.
    pub fn fill(&mut self, name: impl Into<Cow<'static, str>>, buffer: Res<Buffer>, value: u32) {
        self.transfer(name.into(), &[("buffer", buffer.any, Access::Write)], |descs, index| {
            let bytes = descs[0].bytes();
            if !bytes.is_multiple_of(4) {
                return Err(Mistake::new(format!("{bytes} bytes are no multiple of 4")).at("buffer"));
            }
            Ok(Work::Fill { buffer: index[0], value })
        });
    }

    /// Sets every texel of an image to zero.
    pub fn clear_image(&mut self, name: impl Into<Cow<'static, str>>, image: Res<Image>) {
        let operands = [("image", image.any, Access::Write)];
        self.transfer(name.into(), &operands, |_, index| Ok(Work::Clear { image: index[0] }));
    }

    /// A transient buffer that holds `contents` before the first pass: no pass waits for them alone.
    pub fn buffer_with(&mut self, name: &'static str, contents: Vec<u8>) -> Res<Buffer> {
        let buffer = self.buffer(name, contents.len() as u64);
        let recorded = self.passes.len();
        self.upload(name, buffer, contents);
        let added = self.passes.len() - recorded;
        self.passes.rotate_right(added);
        buffer
    }

    /// Copies bytes to the start of a buffer, which must hold them.
    pub fn upload(&mut self, name: impl Into<Cow<'static, str>>, buffer: Res<Buffer>, bytes: Vec<u8>) {
        let at = advance(&mut self.upload_bytes, bytes.len() as u64);
        self.transfer(name.into(), &[("buffer", buffer.any, Access::Write)], |descs, index| {
            let (given, room) = (bytes.len() as u64, descs[0].bytes());
            if given > room {
                return Err(Mistake::new(format!("{given} bytes for a buffer of {room}")).at("buffer"));
            }
            Ok(Work::Upload { to: index[0], at, bytes })
        });
    }

    /// Copies tightly packed texels, row by row from the top left, to a whole image.
    pub fn upload_image(&mut self, name: impl Into<Cow<'static, str>>, image: Res<Image>, texels: Vec<u8>) {
        let at = advance(&mut self.upload_bytes, texels.len() as u64);
        self.transfer(name.into(), &[("image", image.any, Access::Write)], |descs, index| {
            let (given, room) = (texels.len() as u64, descs[0].bytes());
            if given != room {
                return Err(Mistake::new(format!("{given} bytes for an image of {room}")).at("image"));
            }
            Ok(Work::Upload { to: index[0], at, bytes: texels })
        });
    }

    /// Copies `size` bytes from one buffer to another.
    pub fn copy_buffer(
        &mut self,
        name: impl Into<Cow<'static, str>>,
        (from, from_offset): (Res<Buffer>, u64),
        (to, to_offset): (Res<Buffer>, u64),
        size: u64,
    ) {
        let operands = [("from", from.any, Access::Read), ("to", to.any, Access::Write)];
        self.transfer(name.into(), &operands, |descs, index| {
            for ((desc, offset), variable) in descs.iter().zip([from_offset, to_offset]).zip(["from", "to"]) {
                if offset.checked_add(size).is_none_or(|end| end > desc.bytes()) {
                    let what = format!("{size} bytes at byte {offset} reach past the end, {}", desc.bytes());
                    return Err(Mistake::new(what).at(variable));
                }
            }
            if size == 0 {
                return Err(Mistake::new("copies no bytes"));
            }
            if index[0] == index[1] && from_offset.abs_diff(to_offset) < size {
                return Err(Mistake::new("copies a buffer over itself"));
            }
            Ok(Work::CopyBuffer { from: index[0], from_offset, to: index[1], to_offset, size })
        });
    }

    /// Copies an image to another of the same size and format.
    pub fn copy_image(&mut self, name: impl Into<Cow<'static, str>>, from: Res<Image>, to: Res<Image>) {
        let operands = [("from", from.any, Access::Read), ("to", to.any, Access::Write)];
        self.transfer(name.into(), &operands, |descs, index| {
            if descs[0] != descs[1] {
                return Err(Mistake::new(format!("{:?} is copied to {:?}", descs[0], descs[1])));
            }
            if index[0] == index[1] {
                return Err(Mistake::new("copies an image over itself"));
            }
            Ok(Work::CopyImage { from: index[0], to: index[1] })
        });
    }

    /// Asks for a buffer's contents as they are at this point of the recording.
    pub fn read_buffer<T: Pod>(&mut self, buffer: Res<Buffer>) -> Ticket<T> {
        self.readback(buffer.any)
    }

    /// Asks for an image's texels as they are at this point of the recording, row by row from the top left,
    /// tightly packed. `T` may be a texel (`[f32; 4]`) or a component (`f32`).
    pub fn read_image<T: Pod>(&mut self, image: Res<Image>) -> Ticket<T> {
        self.readback(image.any)
    }

    /// Asks for what a recorded pass leaves in one of its resources, `"path/of/pass:variable"`. The variable
    /// is the shader's, or the resource's own name.
    ///
    /// # Errors
    /// A name that is not there, with those that are.
    pub fn tap(&mut self, spec: &str) -> Result<Tap, Error> {
        let (path, variable) = spec
            .rsplit_once(':')
            .ok_or_else(|| Mistake::new(format!("tap `{spec}` is not of the form `PASS:VARIABLE`")))?;
        let passes = || self.passes.iter().filter(|p| !matches!(p.work, Work::Readback { .. }));
        let pass = self.passes.iter().position(|p| p.path == path).ok_or_else(|| {
            let names = || passes().map(|p| &*p.path);
            let what = format!(
                "no pass `{path}` to tap{}; there are {}",
                suggestion(path, names()),
                quoted(names())
            );
            Mistake::new(what)
        })?;
        let tappable = || self.passes[pass].uses.iter().filter(|u| u.resource != SCENE);
        let resource = tappable()
            .find(|u| u.variable == variable)
            .or_else(|| tappable().find(|u| self.resources[u.resource as usize].name == variable))
            .map(|u| u.resource)
            .ok_or_else(|| {
                let names = || tappable().map(|u| &*u.variable);
                let what = format!(
                    "no variable `{variable}` to tap{}; there are {}",
                    suggestion(variable, names()),
                    quoted(names())
                );
                Mistake::new(what).in_pass(path)
            })?;
        let desc = self.resources[resource as usize].desc;
        let ticket = self.ticket(desc.bytes());
        let uses =
            vec![Use { resource, variable: "source".into(), stages: Stages::TRANSFER, access: Access::Read }];
        let work = Work::Readback { from: resource, ticket: ticket.index };
        let path = self.at_root(|g| g.path(&format!("tap/{spec}")));
        self.passes.insert(pass + 1, PassDecl { path, uses, work });
        Ok(Tap { ticket, desc })
    }

    /// Records the pass that `work` makes of its operands' descriptions and indices, or remembers the mistake.
    fn transfer(
        &mut self,
        name: Cow<'static, str>,
        operands: &[(&'static str, AnyRes, Access)],
        work: impl FnOnce(&[Desc], &[u32]) -> Result<Work, Mistake>,
    ) {
        let path = self.path(&name);
        let uses = operands.iter().map(|&(variable, resource, access)| {
            let index = self.readable(resource, access).map_err(|m| m.at(variable))?;
            Ok(Use { resource: index, variable: variable.into(), stages: Stages::TRANSFER, access })
        });
        let recorded = uses.collect::<Result<Vec<Use>, Mistake>>().and_then(|uses| {
            let indices: Vec<u32> = uses.iter().map(|u| u.resource).collect();
            let descs: Vec<Desc> = indices.iter().map(|&index| self.resources[index as usize].desc).collect();
            Ok((uses, work(&descs, &indices)?))
        });
        match recorded {
            Ok((uses, work)) => self.push(PassDecl { path, uses, work }),
            Err(mistake) => self.remember(Err(mistake.in_pass(&path))),
        }
    }

    fn ticket<T>(&mut self, bytes: u64) -> Ticket<T> {
        let start = advance(&mut self.readback_bytes, bytes);
        self.tickets.push(start..start + bytes);
        Ticket::new(self.id, self.tickets.len() - 1)
    }

    fn readback<T: Pod>(&mut self, resource: AnyRes) -> Ticket<T> {
        let decl = self.own(resource).map(|index| &self.resources[index as usize]);
        let (name, desc) = decl.map_or(("".into(), None), |decl| (decl.name.clone(), Some(decl.desc)));
        let ticket = self.ticket(desc.map_or(0, Desc::bytes));
        let index = ticket.index;
        self.at_root(|g| {
            g.transfer(
                format!("readback/{name}").into(),
                &[("source", resource, Access::Read)],
                |descs, from| {
                    let unit = match descs[0] {
                        Desc::Image(desc) => u64::from(desc.format.size()),
                        desc => desc.bytes(),
                    };
                    let element = size_of::<T>() as u64;
                    if element == 0 || !unit.is_multiple_of(element) {
                        let what = format!("holds no whole number of elements of {element} bytes");
                        return Err(Mistake::new(what).at("source"));
                    }
                    Ok(Work::Readback { from: from[0], ticket: index })
                },
            );
        });
        ticket
    }
}

/// The place of `size` bytes in staging memory, aligned for texels of all formats.
fn advance(at: &mut u64, size: u64) -> u64 {
    let start = *at;
    *at = (start + size).next_multiple_of(16);
    start
}
