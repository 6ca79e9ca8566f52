//! Pictures of a plan.

use super::{
    planned::{Plan, PlannedResource},
    resource::Desc,
    times::PassTime,
};
use crate::text::{printable, printable_lines};
use serde::{Serialize, Serializer, ser::SerializeMap};
use std::fmt::Write;

impl Serialize for Desc {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        match self {
            Self::Buffer(desc) => {
                map.serialize_entry("kind", "buffer")?;
                map.serialize_entry("bytes", &desc.size)?;
            }
            Self::Image(desc) => {
                map.serialize_entry("kind", "image")?;
                map.serialize_entry("extent", &desc.extent)?;
                map.serialize_entry("format", &format!("{:?}", desc.format))?;
                map.serialize_entry("bytes", &desc.bytes())?;
            }
            Self::Scene => map.serialize_entry("kind", "scene")?,
        }
        map.end()
    }
}

/// A later pass that waits for an earlier one's write to a resource.
#[derive(Serialize)]
struct Edge<'p> {
    from: &'p str,
    to: &'p str,
    resource: &'p str,
}

impl Plan {
    /// The plan as a graph for Graphviz: passes are boxes with their barriers, and their times where `times`
    /// has them; resources are ellipses with their memory; culled passes are dashed.
    #[must_use]
    pub fn dot(&self, times: &[PassTime]) -> String {
        let mut dot = String::from("digraph plan {\n  rankdir=LR;\n  node [fontname=\"sans-serif\"];\n");
        for (r, resource) in self.resources.iter().enumerate().filter(|(_, r)| r.lifetime.is_some()) {
            let label = format!("{}\n{}", printable(&resource.name), describe(resource));
            let style = if resource.imported { " peripheries=2" } else { "" };
            line(&mut dot, &format!("r{r} [shape=ellipse{style} label={}]", quote(&label)));
        }
        for (p, pass) in self.passes.iter().enumerate() {
            let mut label = printable(&pass.path).into_owned();
            if let Some(shader) = &pass.shader {
                let _ = write!(label, "\n{}", printable(shader));
            }
            if let Some([x, y, z]) = pass.groups {
                let _ = write!(label, " {x}×{y}×{z}");
            }
            if let Some(barrier) = &pass.barrier {
                let what = if barrier.memory { "memory" } else { "order" };
                if !barrier.before.is_empty() {
                    let _ = write!(label, "\nbarrier {} → {} ({what})", barrier.before, barrier.after);
                }
                for &image in &barrier.initialise {
                    let _ = write!(label, "\ninitialise {}", printable(&self.resources[image].name));
                }
            }
            if let Some(ms) = times.iter().find(|time| time.path == pass.path).and_then(|time| time.ms) {
                let _ = write!(label, "\n{ms:.3} ms");
            }
            line(&mut dot, &format!("p{p} [shape=box label={}]", quote(&label)));
            for access in &pass.accesses {
                let (r, variable) = (access.resource, quote(&printable(&access.variable)));
                if access.reads {
                    line(&mut dot, &format!("r{r} -> p{p} [label={variable}]"));
                }
                if access.writes {
                    line(&mut dot, &format!("p{p} -> r{r} [label={variable}]"));
                }
            }
        }
        for (c, culled) in self.culled.iter().enumerate() {
            let label = quote(&format!("{}\nculled: {}", printable(&culled.path), printable(&culled.why)));
            line(&mut dot, &format!("c{c} [shape=box style=dashed label={label}]"));
        }
        dot.push_str("}\n");
        dot
    }

    /// The plan as JSON: the fields of [`Plan`], each pass with its `ms` where `times` has it, and `edges`
    /// from each write to the passes that use it.
    #[must_use]
    pub fn json(&self, times: &[PassTime]) -> serde_json::Value {
        let mut json = serde_json::to_value(self).expect("a plan has string keys only");
        for (pass, value) in self.passes.iter().zip(json["passes"].as_array_mut().into_iter().flatten()) {
            if let Some(time) = times.iter().find(|time| time.path == pass.path) {
                value["ms"] = time.ms.into();
            }
        }
        json["edges"] = serde_json::to_value(self.edges()).expect("an edge has string keys only");
        json
    }

    fn edges(&self) -> Vec<Edge<'_>> {
        let mut writer = vec![None; self.resources.len()];
        let mut edges = Vec::new();
        for pass in &self.passes {
            for access in &pass.accesses {
                if let Some(from) = writer[access.resource] {
                    edges.push(Edge {
                        from,
                        to: &pass.path,
                        resource: &self.resources[access.resource].name,
                    });
                }
            }
            for access in pass.accesses.iter().filter(|access| access.writes) {
                writer[access.resource] = Some(pass.path.as_str());
            }
        }
        edges
    }
}

fn describe(resource: &PlannedResource) -> String {
    let what = match resource.desc {
        Desc::Buffer(desc) => format!("buffer {} B", desc.size),
        Desc::Image(desc) => format!("image {}×{} {:?}", desc.extent[0], desc.extent[1], desc.format),
        Desc::Scene => "set 0".into(),
    };
    let place = resource.placement.map_or_else(
        || "imported".into(),
        |p| format!("heap {} at {}..{}", p.heap, p.offset, p.offset + p.size),
    );
    let [first, last] = resource.lifetime.unwrap_or_default();
    format!("{what}\n{place}, passes {first}..={last}")
}

/// A label in quotes; its lines begin where it ends them.
fn quote(text: &str) -> String {
    let text = printable_lines(text).replace('\\', "\\\\").replace('"', "\\\"");
    format!("\"{}\"", text.replace('\n', "\\n"))
}

fn line(dot: &mut String, text: &str) {
    dot.push_str("  ");
    dot.push_str(text);
    dot.push_str(";\n");
}
