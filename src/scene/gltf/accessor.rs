//! Checked reading of accessors: every byte is proven to lie in its buffer, and memory to be there, before anything is
//! allocated.

use super::context::{Buffer, Context};
use crate::memory::Budget;
use crate::scene::{Fault, SceneError};
use ::gltf::json::accessor::{Accessor, ComponentType, Type};
use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, buffer};
use std::cell::RefCell;
use std::ops::Range;
use std::path::Path;

/// Most elements of an accessor that has no buffer view, whose zeros are all made here.
const MAX_ZEROS: usize = 1 << 24;

/// An accessor's elements.
pub(super) struct Elements<'a> {
    pub(super) component: ComponentType,
    pub(super) normalized: bool,
    pub(super) shape: Type,
    pub(super) count: usize,
    file: &'a Path,
    budget: &'a RefCell<Budget>,
    element: String,
    /// Bytes and stride; all zeros where absent.
    base: Option<(&'a [u8], usize)>,
    /// Increasing indices of replaced elements, and their values, tightly packed.
    sparse: (Vec<u32>, &'a [u8]),
}

/// Byte range of `count` elements.
struct Extent {
    start: usize,
    stride: usize,
    end: usize,
}

impl<'a> Context<'a> {
    /// Checks accessor `index` and finds its bytes.
    pub(super) fn elements(&self, index: usize) -> Result<Elements<'a>, SceneError> {
        self.read[index].set(true);
        let accessor = &self.root.accessors[index];
        let sparse = accessor.sparse.iter().flat_map(|s| [s.indices.buffer_view, s.values.buffer_view]);
        accessor.buffer_view.into_iter().chain(sparse).try_for_each(|view| self.check_view(view.value()))?;
        let element = format!("accessors[{index}]");
        self.elements_of(accessor, &element).map_err(|problem| self.error(element, problem))
    }

    /// Whether a buffer view lies in its buffer. Where that has no data it lies in its declared length.
    pub(super) fn check_view(&self, index: usize) -> Result<(), SceneError> {
        let view = &self.root.buffer_views[index];
        let buffer = view.buffer.value();
        let length = self.root.buffers[buffer].byte_length.0;
        let end = view.byte_offset.map_or(0, |o| o.0).checked_add(view.byte_length.0);
        match &self.buffers[buffer] {
            Buffer::Lost(problem) => return Err(self.error(format!("buffers[{buffer}]"), problem)),
            Buffer::Data(data)
                if (data.len() as u64) < length && end.is_none_or(|end| end > data.len() as u64) =>
            {
                return Err(self.error(format!("buffers[{buffer}]"), too_short(data, length)));
            }
            _ => {}
        }
        if end.is_none_or(|end| end > length) {
            let problem = format!("ends behind the {length} bytes of buffers[{buffer}]");
            return Err(self.error(format!("bufferViews[{index}]"), problem));
        }
        Ok(())
    }

    fn elements_of(&self, accessor: &Accessor, element: &str) -> Result<Elements<'a>, String> {
        let (Checked::Valid(component), Checked::Valid(shape)) = (accessor.component_type, accessor.type_)
        else {
            return Err("unknown component or element type".into());
        };
        let (component, count) = (component.0, accessor.count.0 as usize);
        if accessor.normalized && matches!(component, ComponentType::F32 | ComponentType::U32) {
            return Err("normalized, but its components are neither 8 nor 16 bits wide".into());
        }
        let (size, pitch) = element_size(component, shape);
        let base = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.map_or(0, |o| o.0);
                let extent = self.extent(view, offset, count, (size, pitch))?;
                Some((self.bytes(view, extent.start..extent.end)?, extent.stride))
            }
            None if count > MAX_ZEROS => {
                return Err(format!("{count} elements without a buffer view, expected at most {MAX_ZEROS}"));
            }
            None => None,
        };
        let sparse = match &accessor.sparse {
            Some(sparse) => {
                let Checked::Valid(index_component) = sparse.indices.component_type else {
                    return Err("sparse indices have an unknown component type".into());
                };
                let replaced = sparse.count.0 as usize;
                if replaced == 0 || replaced > count {
                    return Err(format!("{replaced} sparse elements, expected 1 to {count}"));
                }
                let tight = |view, offset: u64, (size, pitch)| {
                    let extent = self.extent(view, offset, replaced, (size, pitch))?;
                    if extent.stride != pitch {
                        return Err("a buffer view of sparse data has a byteStride".into());
                    }
                    self.bytes(view, extent.start..extent.end)
                };
                let indices = tight(
                    sparse.indices.buffer_view,
                    sparse.indices.byte_offset.0,
                    (index_component.0.size(), index_component.0.size()),
                )?;
                let values = tight(sparse.values.buffer_view, sparse.values.byte_offset.0, (size, pitch))?;
                let indices: Vec<u32> = indices
                    .chunks_exact(index_component.0.size())
                    .map(|bytes| unsigned(bytes, index_component.0))
                    .collect();
                if let Some(i) = indices.windows(2).position(|pair| pair[0] >= pair[1]) {
                    return Err(format!(
                        "sparse index {} does not increase: {} after {}",
                        i + 1,
                        indices[i + 1],
                        indices[i]
                    ));
                }
                if let Some(&last) = indices.last().filter(|&&last| last as usize >= count) {
                    return Err(format!("sparse index {last}, but there are {count} elements"));
                }
                (indices, values)
            }
            None => (Vec::new(), &[][..]),
        };
        let (file, budget, normalized) = (self.file, self.budget, accessor.normalized);
        let element = element.to_owned();
        Ok(Elements { component, normalized, shape, count, file, budget, element, base, sparse })
    }

    /// Where `count` elements of `size` bytes lie in their buffer.
    fn extent(
        &self,
        view: Index<buffer::View>,
        offset: u64,
        count: usize,
        (size, pitch): (usize, usize),
    ) -> Result<Extent, String> {
        let description = &self.root.buffer_views[view.value()];
        let stride = description.byte_stride.map_or(pitch, |stride| stride.0);
        if stride < size {
            return Err(format!(
                "byteStride {stride} of bufferViews[{view}] is less than an element's {size} bytes"
            ));
        }
        let length = match count.checked_sub(1) {
            Some(last) => last.checked_mul(stride).and_then(|bytes| bytes.checked_add(size)),
            None => Some(0),
        };
        let begin = description.byte_offset.map_or(0, |o| o.0 as usize);
        let end = length.and_then(|length| length.checked_add(offset as usize));
        match end {
            Some(end) if end <= description.byte_length.0 as usize => {
                Ok(Extent { start: begin + offset as usize, stride, end: begin + end })
            }
            _ => Err(format!(
                "{count} elements from byte {offset} don't fit into the {} bytes of bufferViews[{view}]",
                description.byte_length.0
            )),
        }
    }

    /// Part of a buffer, in a view that was checked.
    fn bytes(&self, view: Index<buffer::View>, range: Range<usize>) -> Result<&'a [u8], String> {
        let description = &self.root.buffer_views[view.value()];
        let buffer = description.buffer.value();
        match &self.buffers[buffer] {
            Buffer::Data(data) => {
                data.get(range).ok_or_else(|| format!("buffers[{buffer}] is too short for it"))
            }
            Buffer::Lost(problem) => Err(format!("buffers[{buffer}]: {problem}")),
            Buffer::Nowhere => {
                let others = description.extensions.iter().flat_map(|extensions| extensions.others.keys());
                let compressed = others
                    .map(|name| format!(": {name}, which is not supported, has them in bufferViews[{view}]"));
                let compressed = compressed.take(1).collect::<String>();
                Err(format!("buffers[{buffer}] has no uri, so there are no data{compressed}"))
            }
        }
    }

    /// All bytes of a buffer view.
    pub(super) fn view_bytes(&self, view: Index<buffer::View>) -> Result<&'a [u8], SceneError> {
        self.check_view(view.value())?;
        let description = &self.root.buffer_views[view.value()];
        let start = description.byte_offset.map_or(0, |o| o.0 as usize);
        self.bytes(view, start..start + description.byte_length.0 as usize)
            .map_err(|problem| self.error(format!("bufferViews[{view}]"), problem))
    }
}

/// What a buffer lacks of its declared `length`.
pub(super) fn too_short(data: &[u8], length: u64) -> String {
    format!("truncated: {} of {length} bytes", data.len())
}

impl Elements<'_> {
    /// Elements `range` as vectors of `N` floats, integers normalised where the accessor says so.
    ///
    /// # Errors
    /// A value that is not finite.
    pub(super) fn floats<const N: usize>(&self, range: Range<usize>) -> Result<Vec<[f32; N]>, SceneError> {
        let (width, normalized) = (self.component.size(), self.normalized);
        let value = |bytes: &[u8]| -> [f32; N] {
            std::array::from_fn(|i| float(&bytes[i * width..(i + 1) * width], self.component, normalized))
        };
        let values = self.read(range.clone(), [0.0; N], value)?;
        match values.iter().position(|value| !value.iter().all(|v| v.is_finite())) {
            Some(i) => {
                let problem = format!("element {} is not finite: {:?}", range.start + i, values[i]);
                Err(SceneError::new(self.file, &self.element, problem))
            }
            None => Ok(values),
        }
    }

    /// All elements, which must be unsigned scalars.
    pub(super) fn unsigned(&self) -> Result<Vec<u32>, SceneError> {
        self.read(0..self.count, 0, |bytes| unsigned(bytes, self.component))
    }

    /// Elements `range` as `N` unsigned integers each.
    pub(super) fn integers<const N: usize>(&self, range: Range<usize>) -> Result<Vec<[u32; N]>, SceneError> {
        let width = self.component.size();
        let value = |bytes: &[u8]| std::array::from_fn(|i| unsigned(&bytes[i * width..], self.component));
        self.read(range, [0; N], value)
    }

    /// Its place in the file.
    pub(super) fn element(&self) -> &str {
        &self.element
    }

    /// Whether all elements are zero since nothing says what they are.
    pub(super) fn is_zero(&self) -> bool {
        self.base.is_none() && self.sparse.0.is_empty()
    }

    fn read<T: Copy>(
        &self,
        range: Range<usize>,
        zero: T,
        value: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        let bytes = range.len() as u64 * size_of::<T>() as u64;
        let taken = self.budget.borrow_mut().take(bytes);
        taken.map_err(|shortage| Fault::from(shortage).of(self.file, &self.element))?;
        let (size, pitch) = element_size(self.component, self.shape);
        let mut values = match self.base {
            Some((bytes, stride)) => {
                range.clone().map(|i| value(&bytes[i * stride..i * stride + size])).collect()
            }
            None => vec![zero; range.len()],
        };
        for (&i, bytes) in self.sparse.0.iter().zip(self.sparse.1.chunks(pitch)) {
            if range.contains(&(i as usize)) {
                values[i as usize - range.start] = value(&bytes[..size]);
            }
        }
        Ok(values)
    }
}

/// Bytes of an element, and from one to the next where they are tight; columns of matrices begin at multiples of four.
fn element_size(component: ComponentType, shape: Type) -> (usize, usize) {
    let columns = match shape {
        Type::Mat2 => 2,
        Type::Mat3 => 3,
        Type::Mat4 => 4,
        _ => {
            let size = component.size() * shape.multiplicity();
            return (size, size);
        }
    };
    let column = component.size() * columns;
    let pitch = columns * column.next_multiple_of(4);
    (pitch - column.next_multiple_of(4) + column, pitch)
}

fn unsigned(bytes: &[u8], component: ComponentType) -> u32 {
    match component.size() {
        1 => u32::from(bytes[0]),
        2 => u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
        _ => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
    }
}

/// glTF 2.0, section 3.6.2.2, gives the normalised values.
fn float(bytes: &[u8], component: ComponentType, normalized: bool) -> f32 {
    let (value, largest) = match component {
        ComponentType::I8 => (f32::from(bytes[0] as i8), 127.0),
        ComponentType::U8 => (f32::from(bytes[0]), 255.0),
        ComponentType::I16 => (f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
        ComponentType::U16 => (f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
        ComponentType::U32 => return unsigned(bytes, component) as f32,
        ComponentType::F32 => return f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
    };
    if normalized { (value / largest).max(-1.0) } else { value }
}
