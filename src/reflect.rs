//! What a SPIR-V module declares, read with `spirq`. The build script and kernels compiled at run time
//! share this file.

use crate::vk::{Access, Binding, BindingKind, Format, ParamMember};
use spirq::prelude::*;
use spirq::ty::{ImageFormat, ScalarType, StructType};
use std::collections::BTreeMap;

/// Push constants every Vulkan device offers, in bytes.
pub(crate) const MAX_PARAMS: u32 = 128;

/// A specialization constant with its default as bits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SpecConstant {
    /// GLSL name.
    pub(crate) name: String,
    /// `constant_id`.
    pub(crate) id: u32,
    /// `bool`, `uint`, `int` or `float`.
    pub(crate) ty: String,
    /// Value in the source, as bits.
    pub(crate) default: u32,
}

/// A structure that Rust and GLSL share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Structure {
    /// Members in order.
    pub(crate) members: Vec<ParamMember>,
    /// Bytes, up to the end of the last member.
    pub(crate) size: u32,
}

/// Everything the host needs to know of a compute module.
#[derive(Clone, Debug)]
pub(crate) struct Reflection {
    /// Invocations in a workgroup.
    pub(crate) workgroup: [u32; 3],
    /// Set 1, by binding number.
    pub(crate) bindings: Vec<Binding>,
    /// Push constants.
    pub(crate) params: Structure,
    /// Specialization constants, by id.
    pub(crate) spec: Vec<SpecConstant>,
    /// Whether set 0 is used.
    pub(crate) uses_scene: bool,
    /// Structures found in buffers, by name.
    pub(crate) structures: BTreeMap<String, Structure>,
}

/// Reads an unoptimised module (optimisation drops the names).
///
/// # Errors
/// A sentence naming the variable that breaks a rule of the kernel interface.
pub(crate) fn reflect(words: &[u32]) -> Result<Reflection, String> {
    let entry_points = ReflectConfig::new()
        .spv(without_conditions(words))
        .ref_all_rscs(true)
        .reflect()
        .map_err(|error| format!("reflection failed: {error}"))?;
    let [entry] = entry_points.as_slice() else { return Err("not exactly one entry point".into()) };
    let mut reflection = Reflection {
        workgroup: workgroup(words).ok_or("no local size")?,
        bindings: Vec::new(),
        params: Structure { members: Vec::new(), size: 0 },
        spec: Vec::new(),
        uses_scene: false,
        structures: BTreeMap::new(),
    };
    let defaults = spec_defaults(words);
    for variable in &entry.vars {
        match variable {
            Variable::Descriptor { name, desc_bind, desc_ty, ty, nbind } => {
                if desc_bind.set() == 0 {
                    reflection.uses_scene = true;
                    if let Type::Struct(block) = ty {
                        collect(block, &mut reflection.structures)?;
                    }
                    continue;
                }
                let name = name.as_deref().unwrap_or_default();
                let place = || format!("set {} binding {} `{name}`", desc_bind.set(), desc_bind.bind());
                if desc_bind.set() != 1 || *nbind != 1 {
                    return Err(format!("{}: a kernel's own variables are single, in set 1", place()));
                }
                if name.is_empty() {
                    return Err(format!("{}: a block needs an instance name", place()));
                }
                let (kind, access) = match (desc_ty, ty) {
                    (DescriptorType::StorageBuffer(access), Type::Struct(block)) => {
                        collect(block, &mut reflection.structures)?;
                        (BindingKind::Buffer { stride: stride(block) }, *access)
                    }
                    (DescriptorType::StorageImage(access), Type::StorageImage(image)) => {
                        let format = format_of(image.fmt).ok_or_else(|| {
                            format!("{}: format {:?} is not one of ours", place(), image.fmt)
                        })?;
                        (BindingKind::Image(format), *access)
                    }
                    _ => return Err(format!("{}: only storage buffers and storage images", place())),
                };
                let access = match access {
                    AccessType::ReadOnly => Access::Read,
                    AccessType::WriteOnly => Access::Write,
                    AccessType::ReadWrite => Access::ReadWrite,
                };
                reflection.bindings.push(Binding {
                    name: name.to_owned().into(),
                    binding: desc_bind.bind(),
                    kind,
                    access,
                });
            }
            Variable::PushConstant { ty: Type::Struct(block), .. } => reflection.params = structure(block)?,
            Variable::SpecConstant { name, spec_id, ty } => {
                let name = name.clone().ok_or_else(|| format!("constant_id {spec_id} has no name"))?;
                let ty = type_name(ty)?;
                let default = *defaults.get(spec_id).ok_or_else(|| format!("`{name}` has no default"))?;
                reflection.spec.push(SpecConstant { name, id: *spec_id, ty, default });
            }
            _ => {}
        }
    }
    if reflection.params.size > MAX_PARAMS {
        return Err(format!("push constants take {} bytes, over {MAX_PARAMS}", reflection.params.size));
    }
    reflection.bindings.sort_by_key(|binding| binding.binding);
    reflection.spec.sort_by_key(|constant| constant.id);
    Ok(reflection)
}

fn format_of(format: ImageFormat) -> Option<Format> {
    Some(match format {
        ImageFormat::Rgba32f => Format::Rgba32Float,
        ImageFormat::Rg32f => Format::Rg32Float,
        ImageFormat::R32f => Format::R32Float,
        ImageFormat::Rgba32ui => Format::Rgba32Uint,
        ImageFormat::R32ui => Format::R32Uint,
        ImageFormat::Rgba16f => Format::Rgba16Float,
        ImageFormat::Rgba8 => Format::Rgba8Unorm,
        _ => return None,
    })
}

fn type_name(ty: &Type) -> Result<String, String> {
    let scalar = |scalar: &ScalarType| {
        Ok(match scalar {
            ScalarType::Boolean => "bool",
            ScalarType::Integer { bits: 32, is_signed: false } => "uint",
            ScalarType::Integer { bits: 32, is_signed: true } => "int",
            ScalarType::Integer { bits: 64, is_signed: false } => "uint64_t",
            ScalarType::Float { bits: 32 } => "float",
            other => return Err(format!("type {other} has no twin in Rust")),
        })
    };
    Ok(match ty {
        Type::Scalar(ty) => scalar(ty)?.to_owned(),
        Type::Vector(vector) => {
            let prefix = match scalar(&vector.scalar_ty)? {
                "float" => "",
                "uint" => "u",
                "int" => "i",
                other => return Err(format!("vectors of {other} have no twin in Rust")),
            };
            format!("{prefix}vec{}", vector.nscalar)
        }
        Type::Matrix(matrix) => format!("mat{}x{}", matrix.nvector, matrix.vector_ty.nscalar),
        Type::Struct(structure) => structure.name().ok_or("a structure without a name")?.to_owned(),
        other => return Err(format!("type {other} has no twin in Rust")),
    })
}

fn structure(ty: &StructType) -> Result<Structure, String> {
    let mut members = Vec::new();
    for member in &ty.members {
        let name = member.name.clone().ok_or("a member without a name")?;
        let size = member.ty.nbyte().ok_or_else(|| format!("`{name}` has no size"))? as u32;
        let offset = member.offset.ok_or_else(|| format!("`{name}` has no offset"))? as u32;
        let ty = type_name(&member.ty).map_err(|error| format!("`{name}`: {error}"))?;
        members.push(ParamMember { name: name.into(), ty: ty.into(), offset, size });
    }
    let size = members.iter().map(|member| member.offset + member.size).max().unwrap_or(0);
    Ok(Structure { members, size })
}

/// Structures inside a block: its members and the elements of its arrays.
fn collect(block: &StructType, structures: &mut BTreeMap<String, Structure>) -> Result<(), String> {
    for member in &block.members {
        let ty = match &member.ty {
            Type::Array(array) => &array.element_ty,
            other => other,
        };
        if let Type::Struct(inner) = ty {
            collect(inner, structures)?;
            let name = inner.name().ok_or("a structure without a name")?;
            structures.insert(name.to_owned(), structure(inner).map_err(|error| format!("{name}: {error}"))?);
        }
    }
    Ok(())
}

fn stride(block: &StructType) -> u32 {
    match block.members.last().map(|member| &member.ty) {
        Some(Type::Array(array)) if array.nelement.is_none() => array.stride.unwrap_or(0) as u32,
        _ => 0,
    }
}

/// Instructions as (opcode, operands).
fn instructions(words: &[u32]) -> impl Iterator<Item = (u32, &[u32])> {
    let mut rest = words.get(5..).unwrap_or_default();
    std::iter::from_fn(move || {
        let first = *rest.first()?;
        let length = (first >> 16) as usize;
        let operands = rest.get(1..length)?;
        rest = &rest[length..];
        Some((first & 0xffff, operands))
    })
}

/// `spirq` fails at comparisons of specialization constants, logic between them and choices by them, which decide
/// nothing that is reflected: they become constants.
fn without_conditions(words: &[u32]) -> Vec<u32> {
    const TYPE_BOOL: u32 = 20;
    const CONSTANT_FALSE: u32 = 42;
    const CONSTANT: u32 = 43;
    const SPEC_CONSTANT_OP: u32 = 52;
    const SELECT: u32 = 169;
    let bool_type =
        instructions(words).find(|(opcode, _)| *opcode == TYPE_BOOL).map(|(_, operands)| operands[0]);
    let mut simpler = words.get(..5).unwrap_or_default().to_vec();
    for (opcode, operands) in instructions(words) {
        match operands {
            [ty, result, ..] if opcode == SPEC_CONSTANT_OP && Some(*ty) == bool_type => {
                simpler.extend([3 << 16 | CONSTANT_FALSE, *ty, *result]);
            }
            [ty, result, SELECT, ..] if opcode == SPEC_CONSTANT_OP => {
                simpler.extend([4 << 16 | CONSTANT, *ty, *result, 1]);
            }
            _ => {
                simpler.push((operands.len() as u32 + 1) << 16 | opcode);
                simpler.extend(operands);
            }
        }
    }
    simpler
}

/// Specialization constants of a module by id, which `spirq` does not report the defaults of.
pub(crate) fn spec_defaults(words: &[u32]) -> BTreeMap<u32, u32> {
    const DECORATE: u32 = 71;
    const SPEC_ID: u32 = 1;
    const SPEC_CONSTANT_TRUE: u32 = 48;
    const SPEC_CONSTANT_FALSE: u32 = 49;
    const SPEC_CONSTANT: u32 = 50;
    let mut ids = BTreeMap::new();
    let mut values = BTreeMap::new();
    for (opcode, operands) in instructions(words) {
        match (opcode, operands) {
            (DECORATE, [target, SPEC_ID, id]) => drop(ids.insert(*target, *id)),
            (SPEC_CONSTANT_TRUE, [_, result]) => drop(values.insert(*result, 1)),
            (SPEC_CONSTANT_FALSE, [_, result]) => drop(values.insert(*result, 0)),
            (SPEC_CONSTANT, [_, result, value]) => drop(values.insert(*result, *value)),
            _ => {}
        }
    }
    values.into_iter().filter_map(|(result, value)| Some((*ids.get(&result)?, value))).collect()
}

fn workgroup(words: &[u32]) -> Option<[u32; 3]> {
    const EXECUTION_MODE: u32 = 16;
    const LOCAL_SIZE: u32 = 17;
    const EXECUTION_MODE_ID: u32 = 331;
    const LOCAL_SIZE_ID: u32 = 38;
    const CONSTANT: u32 = 43;
    let constant = |id: u32| {
        instructions(words).find_map(|(opcode, operands)| match (opcode, operands) {
            (CONSTANT, [_, result, value]) if *result == id => Some(*value),
            _ => None,
        })
    };
    instructions(words).find_map(|(opcode, operands)| match (opcode, operands) {
        (EXECUTION_MODE, [_, LOCAL_SIZE, x, y, z]) => Some([*x, *y, *z]),
        (EXECUTION_MODE_ID, [_, LOCAL_SIZE_ID, x, y, z]) => {
            Some([constant(*x)?, constant(*y)?, constant(*z)?])
        }
        _ => None,
    })
}
