//! Vertices, texture coordinates and normals of a whole file, for faces may come before them.

use super::source::Source;
use super::text::{COMMA, CUT, Numbers, finite, split, statements, uncommented};
use crate::scene::{MAX_VERTICES, SceneError, mesh, srgb_to_linear};
use glam::{DVec3, Vec2, Vec3, Vec4};

#[derive(Default)]
pub(super) struct Vertices {
    /// As exact as they are written; NaN where they can't be read.
    pub(super) positions: Vec<DVec3>,
    /// One a position once a vertex has a colour, as it is written; NaN for those without.
    colors: Vec<Vec3>,
    /// NaN where they can't be read.
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    /// Colours are divided by this.
    white: f32,
}

/// A position, and a colour where it has one.
struct Vertex<'a> {
    position: DVec3,
    color: Option<Vec3>,
    numbers: Numbers<'a>,
}

impl<'a> Vertex<'a> {
    fn of(code: &'a str) -> Result<Self, String> {
        let numbers = Numbers::of(code);
        let (x, y, z, color) = match *numbers.values() {
            // Four are weights of curves, or of the whole.
            [x, y, z] | [x, y, z, _] | [x, y, z, _, _] => (x, y, z, None),
            // Of seven the last is an alpha.
            [x, y, z, r, g, b, ..] => (x, y, z, Some(Vec3::new(r as f32, g as f32, b as f32))),
            _ => {
                return Err(match numbers.rest {
                    Some(word) => format!("`{word}` is not a number"),
                    None => format!("a vertex has 3, 4 or 6 numbers, this one {}", numbers.values().len()),
                });
            }
        };
        for value in [x, y, z] {
            finite(value)?;
        }
        Ok(Self { position: DVec3::new(x, y, z), color, numbers })
    }
}

impl Vertices {
    pub(super) fn read(source: &Source<'_>, text: &str) -> Result<Self, SceneError> {
        let mut all = Self { white: 1.0, ..Self::default() };
        for (line, statement) in statements(text) {
            let (keyword, rest) = split(&statement);
            let code = uncommented(rest);
            let count = match &*keyword {
                "v" => all.vertex(source, line, code)?,
                "vt" => all.texture_coordinate(source, line, code)?,
                "vn" => all.normal(source, line, code)?,
                _ => continue,
            };
            // Twice what they are, as vectors grow.
            source.take(2 * size_of::<DVec3>() as u64).map_err(|shortage| source.short(shortage))?;
            if count > MAX_VERTICES {
                let problem = format!("more than {MAX_VERTICES} vertices");
                return Err(SceneError::new(source.path, format!("line {line}"), problem));
            }
        }
        all.scale_colors(source)?;
        Ok(all)
    }

    fn vertex(&mut self, source: &Source<'_>, line: usize, code: &str) -> Result<usize, SceneError> {
        let (position, color) = match Vertex::of(code) {
            Ok(vertex) => {
                let is_odd = matches!(vertex.numbers.values().len(), 5 | 8);
                check(source, line, &vertex.numbers, if is_odd { Some(code) } else { None })?;
                (vertex.position, vertex.color)
            }
            Err(problem) => {
                source.mend(source.path, line, problem, "no face uses such vertices")?;
                (DVec3::NAN, None)
            }
        };
        if let Some(color) = color {
            if self.colors.is_empty() {
                source
                    .take((2 * size_of::<Vec3>() * self.positions.len()) as u64)
                    .map_err(|shortage| source.short(shortage))?;
            }
            self.colors.resize(self.positions.len(), Vec3::NAN);
            if !color.is_finite() {
                source.mend(
                    source.path,
                    line,
                    "its colour is not finite",
                    "vertices without a colour are white",
                )?;
            }
            self.colors.push(color);
        } else if !self.colors.is_empty() {
            self.colors.push(Vec3::NAN);
        }
        self.positions.push(position);
        Ok(self.positions.len())
    }

    fn texture_coordinate(
        &mut self,
        source: &Source<'_>,
        line: usize,
        code: &str,
    ) -> Result<usize, SceneError> {
        let numbers = Numbers::of(code);
        let read = match *numbers.values() {
            [] => Err("a texture coordinate has 1 to 3 numbers".to_owned()),
            [u] => finite(u).map(|u| Vec2::new(u, 1.0)),
            [u, v, ..] => finite(u).and_then(|u| Ok(Vec2::new(u, 1.0 - finite(v)?))),
        };
        let uv = match read {
            Ok(uv) => {
                check(source, line, &numbers, numbers.values().get(3).map(|_| code))?;
                uv
            }
            Err(problem) => {
                source.mend(source.path, line, problem, "corners go without such texture coordinates")?;
                Vec2::NAN
            }
        };
        self.uvs.push(uv);
        Ok(self.uvs.len())
    }

    fn normal(&mut self, source: &Source<'_>, line: usize, code: &str) -> Result<usize, SceneError> {
        let numbers = Numbers::of(code);
        let read = match *numbers.values() {
            [x, y, z, ..] => [x, y, z]
                .map(finite)
                .into_iter()
                .collect::<Result<Vec<f32>, _>>()
                .map(|n| Vec3::from_slice(&n)),
            _ => Err("a normal has 3 numbers".to_owned()),
        };
        let normal = match read {
            Ok(normal) => {
                check(source, line, &numbers, numbers.values().get(3).map(|_| code))?;
                mesh::unit_normal(normal)
            }
            Err(problem) => {
                source.mend(
                    source.path,
                    line,
                    problem,
                    "corners have their triangle's own instead of such normals",
                )?;
                Vec3::ZERO
            }
        };
        self.normals.push(normal);
        Ok(self.normals.len())
    }

    /// Finds what white is: 1, or 255 where colours are bytes.
    fn scale_colors(&mut self, source: &Source<'_>) -> Result<(), SceneError> {
        let finite = self.colors.iter().filter(|color| color.is_finite());
        let brightest = finite.fold(0.0, |brightest: f32, color| brightest.max(color.max_element()));
        let problem = format!("vertex colours up to {brightest}, expected up to 1");
        if brightest >= 2.0 {
            self.white = 255.0;
            source.mend_whole(problem, "255 is taken for white")?;
        } else if brightest > 1.001 {
            source.mend_whole(problem, "they are clamped")?;
        }
        self.colors.resize(self.positions.len(), Vec3::NAN);
        Ok(())
    }

    /// The colour of a vertex, linear; none where it has none.
    pub(super) fn color(&self, vertex: u32) -> Option<Vec4> {
        let encoded = *self.colors.get(vertex as usize).filter(|color| color.is_finite())?;
        Some((encoded / self.white).clamp(Vec3::ZERO, Vec3::ONE).map(srgb_to_linear).extend(1.0))
    }

    /// Line and defect of a vertex that can't be read.
    pub(super) fn defect(text: &str, vertex: u32) -> (usize, String) {
        let vertices = statements(text).filter(|(_, statement)| split(statement).0 == "v");
        let found = vertices.map(|(line, statement)| {
            let problem = Vertex::of(uncommented(split(&statement).1)).err();
            (line, problem.unwrap_or_default())
        });
        found.into_iter().nth(vertex as usize).unwrap_or_default()
    }
}

/// Notes what is odd about numbers that are there; `more` are too many.
fn check(
    source: &Source<'_>,
    line: usize,
    numbers: &Numbers<'_>,
    more: Option<&str>,
) -> Result<(), SceneError> {
    if let Some(word) = numbers.comma {
        source.mend(source.path, line, format!("`{word}` has a comma"), COMMA)?;
    }
    if let Some(rest) = numbers.rest.or(more) {
        let problem = format!("`{}` is more than a number of it", crate::scene::file::shortened(rest));
        source.mend(source.path, line, problem, CUT)?;
    }
    Ok(())
}
