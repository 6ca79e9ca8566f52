//! Tests of recording, planning, placing, the oracle and the dumps; none needs a device.

use super::*;
use crate::vk::{Access, Binding, BindingKind, Format, KernelCode, Modules, ParamMember};
use proptest::{collection::vec, prelude::*};
use std::{borrow::Cow, sync::Arc};

const FORMAT: Format = Format::Rgba16Float;

fn code(bindings: &[(&'static str, BindingKind, Access)]) -> KernelCode {
    let bindings = (0..).zip(bindings).map(|(i, &(name, kind, access))| Binding {
        name: name.into(),
        binding: i,
        kind,
        access,
    });
    KernelCode {
        name: "test/kernel".into(),
        workgroup: [8, 8, 1],
        bindings: bindings.collect(),
        params_size: 0,
        params: Cow::Borrowed(&[]),
        spec_ids: Cow::Borrowed(&[]),
        uses_scene: false,
        modules: Modules::Plain(Cow::Borrowed(&[])),
    }
}

fn kernel(bindings: &[(&'static str, BindingKind, Access)]) -> RuntimeKernel {
    RuntimeKernel::new(Arc::new(code(bindings)), Vec::new())
}

const IMAGE: BindingKind = BindingKind::Image(FORMAT);
const BUFFER: BindingKind = BindingKind::Buffer { stride: 16 };
const GRID: Grid = Grid::Of([64, 64, 1]);

/// A pass that reads and writes the given images.
fn image_pass(g: &mut Graph, name: &'static str, reads: &[Res<Image>], writes: &[Res<Image>]) {
    const NAMES: [&str; 6] = ["a", "b", "c", "d", "e", "f"];
    let accesses = reads.iter().map(|_| Access::Read).chain(writes.iter().map(|_| Access::Write));
    let bindings: Vec<_> = NAMES.iter().zip(accesses).map(|(&name, access)| (name, IMAGE, access)).collect();
    let bound: Vec<(&str, AnyRes)> =
        NAMES.iter().zip(reads.iter().chain(writes)).map(|(&name, &res)| (name, res.into())).collect();
    g.pass_named(name, &kernel(&bindings), &bound, [].as_slice() as &[u8], GRID).unwrap();
}

fn small() -> ImageDesc {
    ImageDesc::new([64, 64], FORMAT)
}

fn barrier(plan: &Plan, path: &str) -> Option<Barrier> {
    plan.passes.iter().find(|pass| pass.path == path).expect("the pass was kept").barrier.clone()
}

fn resource<'p>(plan: &'p Plan, name: &str) -> &'p PlannedResource {
    plan.resources.iter().find(|r| r.name == name).expect("the resource was declared")
}

/// A device whose images and buffers live in memory of different kinds and alignments.
#[derive(Clone, Copy, Debug)]
struct Table {
    buffer_bits: u32,
    image_bits: u32,
    alignment: u64,
    max_allocation: u64,
}

impl Requirements for Table {
    fn buffer(&self, size: u64) -> Memory {
        Memory { size, alignment: self.alignment, memory_type_bits: self.buffer_bits }
    }

    fn image(&self, desc: ImageDesc) -> Memory {
        let size = desc.bytes() + 64;
        Memory { size, alignment: 4 * self.alignment, memory_type_bits: self.image_bits }
    }

    fn limits(&self) -> Limits {
        Limits { max_allocation: self.max_allocation, ..Typical.limits() }
    }
}

#[derive(Clone, Debug)]
struct RandomPass {
    kind: u8,
    uses: Vec<(usize, u8)>,
}

#[derive(Clone, Debug)]
struct RandomGraph {
    /// Kind and size of each resource.
    resources: Vec<(u8, u32)>,
    passes: Vec<RandomPass>,
    table: Table,
}

fn random_graph() -> impl Strategy<Value = RandomGraph> {
    let table = (1_u32..4, 1_u32..4, 0_u32..5, 1_u64..9).prop_map(|(b, i, a, max)| Table {
        buffer_bits: b,
        image_bits: i,
        alignment: 16 << a,
        max_allocation: max << 13,
    });
    let pass =
        (0_u8..14, vec((0_usize..64, 0_u8..3), 1..5)).prop_map(|(kind, uses)| RandomPass { kind, uses });
    (vec((0_u8..8, 1_u32..24), 1..14), vec(pass, 1..24), table)
        .prop_map(|(resources, passes, table)| RandomGraph { resources, passes, table })
}

enum Handle {
    Buffer(Res<Buffer>),
    Image(Res<Image>),
}

impl From<&Handle> for AnyRes {
    fn from(handle: &Handle) -> Self {
        match *handle {
            Handle::Buffer(res) => res.into(),
            Handle::Image(res) => res.into(),
        }
    }
}

/// Records a legal graph: reads of what nothing has written become writes.
fn record(random: &RandomGraph) -> Graph {
    let mut g = Graph::new();
    let mut written = Vec::new();
    let mut handles = Vec::new();
    for (i, &(kind, size)) in random.resources.iter().enumerate() {
        let (name, bytes) = (format!("r{i}"), u64::from(size) * 64);
        let desc = ImageDesc::new([size, 8], FORMAT);
        let imported = kind >= 6;
        handles.push(match (kind % 2, imported) {
            (0, false) => Handle::Buffer(g.buffer(name, bytes)),
            (0, true) => Handle::Buffer(g.declare_buffer(name, bytes)),
            (_, false) => Handle::Image(g.image(name, desc)),
            (_, true) => Handle::Image(g.declare_image(name, desc)),
        });
        written.push(imported);
    }
    for (p, pass) in random.passes.iter().enumerate() {
        let mut uses: Vec<(usize, Access)> = Vec::new();
        for &(r, access) in &pass.uses {
            let r = r % handles.len();
            let access = [Access::Read, Access::Write, Access::ReadWrite][usize::from(access)];
            if !uses.iter().any(|&(other, _)| other == r) {
                uses.push((r, if written[r] { access } else { Access::Write }));
            }
        }
        let (first, name) = (uses[0].0, format!("p{p}"));
        match (pass.kind, &handles[first]) {
            (0, Handle::Buffer(buffer)) => {
                g.fill(name, *buffer, 1);
                written[first] = true;
            }
            (0, Handle::Image(image)) => {
                g.clear_image(name, *image);
                written[first] = true;
            }
            (1, Handle::Buffer(buffer)) if written[first] => {
                g.read_buffer::<u32>(*buffer);
            }
            (1, Handle::Image(image)) if written[first] => {
                g.read_image::<u32>(*image);
            }
            (2, _) => {
                let accesses: Vec<(AnyRes, Access)> =
                    uses.iter().map(|&(r, access)| ((&handles[r]).into(), access)).collect();
                g.raw(name, &accesses, |_| {});
                uses.iter().filter(|(_, access)| access.writes()).for_each(|&(r, _)| written[r] = true);
            }
            _ => {
                const NAMES: [&str; 5] = ["a", "b", "c", "d", "e"];
                let mut grid = GRID;
                if let (3, true, Handle::Buffer(buffer)) = (pass.kind, written[first], &handles[first]) {
                    grid = Grid::Indirect { buffer: *buffer, offset: 8 };
                }
                let bindings: Vec<_> = (NAMES.iter().zip(&uses))
                    .map(|(&name, &(r, access))| {
                        (name, if matches!(handles[r], Handle::Buffer(_)) { BUFFER } else { IMAGE }, access)
                    })
                    .collect();
                let bound: Vec<(&str, AnyRes)> =
                    NAMES.iter().zip(&uses).map(|(&name, &(r, _))| (name, (&handles[r]).into())).collect();
                let mut code = code(&bindings);
                code.uses_scene = pass.kind == 4;
                let kernel = RuntimeKernel::new(Arc::new(code), Vec::new());
                g.pass_named(name, &kernel, &bound, [].as_slice() as &[u8], grid).unwrap();
                uses.iter().filter(|(_, access)| access.writes()).for_each(|&(r, _)| written[r] = true);
            }
        }
    }
    g
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_graphs_satisfy_the_oracle(random in random_graph(), alias: bool) {
        let plan = record(&random).plan_with(&random.table, alias).unwrap();
        prop_assert_eq!(check(&plan), Ok(()));
    }

    /// No barrier is missing and none is superfluous: the oracle misses each one that is taken away.
    /// The oracle reads sets of stages, the device the masks they are sent as.
    #[test]
    fn masks_order_what_stages_do(random in random_graph(), alias: bool) {
        let mut plan = record(&random).plan_with(&Typical, alias).unwrap();
        let covered = |stages: Stages| {
            type S = ash::vk::PipelineStageFlags2;
            let flags = stages.flags();
            let all = flags.contains(S::ALL_COMMANDS);
            let names = [(S::COMPUTE_SHADER, Stages::COMPUTE), (S::ALL_TRANSFER, Stages::TRANSFER), (S::DRAW_INDIRECT, Stages::INDIRECT)];
            let some = names.into_iter().filter(|(flag, _)| flags.contains(*flag));
            if all { Stages::ALL } else { some.fold(Stages::NONE, |all, (_, stage)| all | stage) }
        };
        for barrier in plan.passes.iter_mut().filter_map(|pass| pass.barrier.as_mut()) {
            (barrier.before, barrier.after) = (covered(barrier.before), covered(barrier.after));
        }
        check(&plan).unwrap();
    }

    #[test]
    fn every_barrier_is_needed(random in random_graph(), alias: bool) {
        let plan = record(&random).plan_with(&random.table, alias).unwrap();
        for (p, pass) in plan.passes.iter().enumerate() {
            let Some(barrier) = &pass.barrier else { continue };
            let with = |barrier: Option<Barrier>| {
                let mut plan = plan.clone();
                plan.passes[p].barrier = barrier;
                check(&plan)
            };
            prop_assert!(with(None).is_err(), "{} needs no {barrier:?}", pass.path);
            if barrier.memory {
                let order = Barrier { memory: false, ..barrier.clone() };
                prop_assert!(with(Some(order)).is_err(), "{} needs no memory in {barrier:?}", pass.path);
            }
            if !barrier.before.is_empty() {
                let layouts = Barrier { before: Stages::NONE, ..barrier.clone() };
                prop_assert!(with(Some(layouts)).is_err(), "{} waits for nothing in {barrier:?}", pass.path);
            }
            for i in 0..barrier.initialise.len() {
                let mut fewer = barrier.clone();
                fewer.initialise.remove(i);
                prop_assert!(with(Some(fewer)).is_err());
            }
        }
    }

    #[test]
    fn placements_are_aligned_disjoint_and_no_larger_than_apart(random in random_graph()) {
        let graph = record(&random);
        let shared = graph.plan(&random.table).unwrap();
        let apart = graph.plan_with(&random.table, false).unwrap();
        prop_assert!(shared.transient_bytes <= shared.unaliased_bytes);
        prop_assert_eq!(shared.unaliased_bytes, apart.transient_bytes);
        for plan in [&shared, &apart] {
            prop_assert_eq!(plan.transient_bytes, plan.heaps.iter().map(|heap| heap.size).sum::<u64>());
            for resource in &plan.resources {
                prop_assert_eq!(resource.placement.is_some(), !resource.imported && resource.lifetime.is_some());
                let Some(placement) = resource.placement else { continue };
                let memory = match resource.desc {
                    Desc::Buffer(desc) => random.table.buffer(desc.size),
                    Desc::Image(desc) => random.table.image(desc),
                    Desc::Scene => unreachable!("the scene is imported"),
                };
                let heap = &plan.heaps[placement.heap];
                prop_assert!(placement.offset.is_multiple_of(memory.alignment));
                prop_assert!(placement.size >= memory.size);
                prop_assert!(heap.memory_type_bits != 0);
                prop_assert_eq!(heap.memory_type_bits & memory.memory_type_bits, heap.memory_type_bits);
                let alone = placement.offset == 0 && placement.size == heap.size;
                prop_assert!(heap.size <= random.table.max_allocation || alone);
            }
        }
        let placed: Vec<Placement> = apart.resources.iter().filter_map(|r| r.placement).collect();
        for (i, one) in placed.iter().enumerate() {
            prop_assert!(placed[i + 1..].iter().all(|other| !one.overlaps(other)));
        }
    }

    /// A pass is kept if and only if something outside sees what it did, by a forward definition.
    #[test]
    fn culling_keeps_what_is_seen(random in random_graph()) {
        let graph = record(&random);
        let passes = &graph.passes;
        let mut seen: Vec<bool> = passes.iter().map(|pass| {
            matches!(pass.work, work::Work::Readback { .. } | work::Work::Raw(_))
                || pass.uses.iter().any(|u| u.access.writes() && graph.resources[u.resource as usize].imported)
        }).collect();
        while let Some(p) = (0..passes.len()).find(|&p| {
            !seen[p] && (p + 1..passes.len()).any(|q| {
                seen[q] && passes[q].uses.iter().any(|r| {
                    r.access.reads() && passes[p].uses.iter().any(|w| w.access.writes() && w.resource == r.resource)
                })
            })
        }) {
            seen[p] = true;
        }
        let plan = graph.plan(&random.table).unwrap();
        let kept: Vec<usize> = plan.passes.iter().map(|pass| pass.recorded).collect();
        let expected: Vec<usize> = (0..passes.len()).filter(|&p| seen[p]).collect();
        prop_assert_eq!(kept, expected);
        prop_assert_eq!(plan.culled.len() + plan.passes.len(), passes.len());
    }

    #[test]
    fn planning_is_deterministic(random in random_graph()) {
        let json = |graph: Graph| graph.plan(&random.table).unwrap().json(&[]).to_string();
        prop_assert_eq!(json(record(&random)), json(record(&random)));
    }
}

#[test]
fn independent_passes_wait_for_nothing() {
    let mut g = Graph::new();
    let input = g.declare_image("input", small());
    let [a, b, sum] = ["a", "b", "sum"].map(|name| g.image(name, small()));
    image_pass(&mut g, "left", &[input], &[a]);
    image_pass(&mut g, "right", &[input], &[b]);
    image_pass(&mut g, "join", &[a, b], &[sum]);
    image_pass(&mut g, "again", &[a, sum], &[input]);
    let plan = g.plan(&Typical).unwrap();
    check(&plan).unwrap();
    let left = barrier(&plan, "left").unwrap();
    assert_eq!((left.before, left.initialise.len()), (Stages::NONE, 3), "all images at once");
    assert_eq!(barrier(&plan, "right"), None);
    assert_eq!(barrier(&plan, "join").unwrap().before, Stages::COMPUTE);
    assert!(barrier(&plan, "join").unwrap().memory);
}

#[test]
fn an_earlier_merged_barrier_is_not_repeated() {
    let mut g = Graph::new();
    let [a, b] = ["a", "b"].map(|name| g.buffer(name, 64));
    let out = g.declare_buffer("out", 64);
    g.fill("fill a", a, 1);
    g.fill("fill b", b, 2);
    let reads = kernel(&[("x", BUFFER, Access::Read), ("y", BUFFER, Access::ReadWrite)]);
    for (name, x) in [("first", a), ("second", b)] {
        g.pass_named(name, &reads, &[("x", x.into()), ("y", out.into())], [].as_slice() as &[u8], GRID)
            .unwrap();
    }
    let plan = g.plan(&Typical).unwrap();
    check(&plan).unwrap();
    let first =
        Barrier { before: Stages::TRANSFER, after: Stages::COMPUTE, memory: true, initialise: vec![] };
    assert_eq!(barrier(&plan, "first"), Some(first));
    let second =
        Barrier { before: Stages::COMPUTE, after: Stages::COMPUTE, memory: true, initialise: vec![] };
    assert_eq!(barrier(&plan, "second"), Some(second), "it waits for `first`, not for `fill b` again");
}

#[test]
fn a_write_after_reads_orders_without_memory() {
    let mut g = Graph::new();
    let [a, out] = ["a", "out"].map(|name| g.declare_buffer(name, 64));
    let reads = kernel(&[("x", BUFFER, Access::Read), ("y", BUFFER, Access::Write)]);
    g.pass_named("read", &reads, &[("x", a.into()), ("y", out.into())], [].as_slice() as &[u8], GRID)
        .unwrap();
    g.fill("overwrite", a, 0);
    let plan = g.plan(&Typical).unwrap();
    check(&plan).unwrap();
    let order =
        Barrier { before: Stages::COMPUTE, after: Stages::TRANSFER, memory: false, initialise: vec![] };
    assert_eq!(barrier(&plan, "overwrite"), Some(order));
}

#[test]
fn an_image_in_used_memory_is_initialised_behind_its_predecessor() {
    let mut g = Graph::new();
    let [a, b, c] = ["a", "b", "c"].map(|name| g.image(name, small()));
    g.clear_image("clear", a);
    image_pass(&mut g, "one", &[a], &[b]);
    image_pass(&mut g, "two", &[b], &[c]);
    g.read_image::<u8>(c);
    let plan = g.plan(&Typical).unwrap();
    check(&plan).unwrap();
    assert_eq!(resource(&plan, "a").placement, resource(&plan, "c").placement);
    assert!(plan.transient_bytes < plan.unaliased_bytes);
    let two = barrier(&plan, "two").unwrap();
    assert_eq!(two.before, Stages::COMPUTE | Stages::TRANSFER);
    assert_eq!(two.initialise, [3]);
}

#[test]
fn a_scene_built_by_a_raw_pass_is_waited_for() {
    let mut g = Graph::new();
    let scene = g.scene();
    let out = g.declare_buffer("out", 64);
    g.raw("build", &[(scene, Access::Write)], |_| {});
    let mut code = code(&[("y", BUFFER, Access::Write)]);
    code.uses_scene = true;
    let kernel = RuntimeKernel::new(Arc::new(code), Vec::new());
    g.pass_named("trace", &kernel, &[("y", out.into())], [].as_slice() as &[u8], GRID).unwrap();
    let plan = g.plan(&Typical).unwrap();
    let wait = Barrier { before: Stages::ALL, after: Stages::COMPUTE, memory: true, initialise: vec![] };
    assert_eq!(barrier(&plan, "trace"), Some(wait));
}

#[test]
fn culled_passes_are_reported() {
    let mut g = Graph::new();
    let [a, b, c] = ["a", "b", "c"].map(|name| g.image(name, small()));
    g.group("wasted", |g| {
        image_pass(g, "first", &[], &[a]);
        image_pass(g, "second", &[a], &[b]);
    });
    image_pass(&mut g, "used", &[], &[c]);
    let _ticket = g.read_image::<[u16; 4]>(c);
    image_pass(&mut g, "late", &[], &[c]);
    let plan = g.plan(&Typical).unwrap();
    let culled: Vec<(&str, &str)> = plan.culled.iter().map(|c| (&*c.path, &*c.why)).collect();
    assert_eq!(
        culled,
        [
            ("wasted/first", "`a` reaches no readback, tap, import or kept resource from here"),
            ("wasted/second", "`b` reaches no readback, tap, import or kept resource from here"),
            ("late", "`c` reaches no readback, tap, import or kept resource from here"),
        ]
    );
    assert!(resource(&plan, "a").placement.is_none());
}

#[test]
fn what_is_kept_needs_no_reader() {
    let mut g = Graph::new();
    let [a, b, c] = ["a", "b", "c"].map(|name| g.image(name, small()));
    image_pass(&mut g, "first", &[], &[a]);
    image_pass(&mut g, "second", &[a], &[b]);
    image_pass(&mut g, "wasted", &[a], &[c]);
    g.keep(b);
    let plan = g.plan(&Typical).unwrap();
    let paths: Vec<_> = plan.passes.iter().map(|pass| &*pass.path).collect();
    assert_eq!(paths, ["first", "second"]);
    let never = g.image("never", small());
    g.keep(never);
    assert!(g.plan(&Typical).unwrap_err().to_string().contains("never"));
}

#[test]
fn a_tap_keeps_its_pass_and_reads_right_behind_it() {
    let mut g = Graph::new();
    let [a, b] = ["a", "image of b"].map(|name| g.image(name, small()));
    g.group("group", |g| {
        image_pass(g, "first", &[], &[a]);
        image_pass(g, "second", &[a], &[b]);
    });
    image_pass(&mut g, "third", &[b], &[a]);
    let tap = g.tap("group/first:a").unwrap();
    assert_eq!(tap.desc, Desc::Image(small()));
    g.tap("group/second:image of b").unwrap();
    let plan = g.plan(&Typical).unwrap();
    let paths: Vec<&str> = plan.passes.iter().map(|pass| &*pass.path).collect();
    assert_eq!(paths, ["group/first", "tap/group/first:a", "group/second", "tap/group/second:image of b"]);
    check(&plan).unwrap();
    let message = |g: &mut Graph, spec| g.tap(spec).unwrap_err().to_string();
    assert_eq!(
        message(&mut g, "group/frist:a"),
        "no pass `group/frist` to tap (did you mean `group/first`?); there are `group/first`, `group/second`, \
         `third`"
    );
    assert_eq!(
        message(&mut g, "group/second:z"),
        "pass `group/second`: no variable `z` to tap (did you mean `a`?); there are `a`, `b`"
    );
    assert_eq!(message(&mut g, "third"), "tap `third` is not of the form `PASS:VARIABLE`");
}

#[test]
fn repeated_paths_are_told_apart() {
    let mut g = Graph::new();
    let a = g.declare_image("a", small());
    for _ in 0..3 {
        g.group("loop", |g| image_pass(g, "step", &[], &[a]));
    }
    let plan = g.plan(&Typical).unwrap();
    let paths: Vec<&str> = plan.passes.iter().map(|pass| &*pass.path).collect();
    assert_eq!(paths, ["loop/step", "loop/step#2", "loop/step#3"]);
}

struct OneImage(Res<Image>);

impl Bindings for OneImage {
    fn resources(&self, out: &mut Vec<AnyRes>) {
        out.push(self.0.into());
    }
}

fn leak(code: KernelCode) -> &'static KernelCode {
    Box::leak(Box::new(code))
}

/// What planning says about a graph recorded by `f`, on a device that takes few workgroups.
fn mistake(f: impl FnOnce(&mut Graph)) -> String {
    struct Small;
    impl Requirements for Small {
        fn buffer(&self, size: u64) -> Memory {
            Typical.buffer(size)
        }
        fn image(&self, desc: ImageDesc) -> Memory {
            Typical.image(desc)
        }
        fn limits(&self) -> Limits {
            Limits {
                max_groups: [8, 8, 8],
                max_storage_buffer_range: 4096,
                max_buffer: 1 << 16,
                max_image_side: 256,
                ..Typical.limits()
            }
        }
    }
    let mut g = Graph::new();
    f(&mut g);
    g.plan(&Small).unwrap_err().to_string()
}

#[test]
fn mistakes_name_pass_shader_and_variable() {
    let write: Kernel<OneImage, ()> = Kernel::new(leak(code(&[("dst", IMAGE, Access::Write)])), vec![]);
    let read: Kernel<OneImage, ()> = Kernel::new(leak(code(&[("src", IMAGE, Access::Read)])), vec![]);
    let extra: Kernel<OneImage, u32> = Kernel::new(leak(code(&[("src", IMAGE, Access::Write)])), vec![]);
    let spec: Kernel<OneImage, ()> = Kernel::new(leak(code(&[("src", IMAGE, Access::Write)])), vec![7]);
    let buffers = kernel(&[("data", BUFFER, Access::Write)]);

    let wrong_format = |g: &mut Graph| {
        let a = g.image("a", small().with_format(Format::R32Float));
        g.group("group", |g| g.pass("write", &write, OneImage(a), (), GRID));
    };
    let foreign = |g: &mut Graph| {
        let a = Graph::new().image("a", small());
        g.pass("write", &write, OneImage(a), (), GRID);
    };
    let unwritten = |g: &mut Graph| {
        let a = g.image("a", small());
        g.pass("read", &read, OneImage(a), (), GRID);
    };
    let params = |g: &mut Graph| {
        let a = g.image("a", small());
        g.pass("write", &extra, OneImage(a), 1, GRID);
    };
    let constants = |g: &mut Graph| {
        let a = g.image("a", small());
        g.pass("write", &spec, OneImage(a), (), GRID);
    };
    let groups = |g: &mut Graph| {
        let a = g.image("a", small());
        g.pass("write", &write, OneImage(a), (), Grid::Of([65, 8, 1]));
    };
    let large = |g: &mut Graph| {
        let b = g.buffer("b", 8192);
        g.pass_named("write", &buffers, &[("data", b.into())], [].as_slice() as &[u8], GRID).unwrap();
    };
    let indirect = |g: &mut Graph| {
        let a = g.image("a", small());
        let b = g.declare_buffer("b", 16);
        g.pass("write", &write, OneImage(a), (), Grid::Indirect { buffer: b, offset: 8 });
    };
    let empty = |g: &mut Graph| {
        g.image("a", ImageDesc::new([64, 0], FORMAT));
    };
    let wide = |g: &mut Graph| {
        g.image("a", ImageDesc::new([64, 257], FORMAT));
    };
    let long = |g: &mut Graph| {
        g.buffer("b", 65537);
    };
    let readback = |g: &mut Graph| {
        let b = g.declare_buffer("b", 6);
        g.read_buffer::<u32>(b);
    };
    let readback_unwritten = |g: &mut Graph| {
        let b = g.buffer("b", 8);
        g.read_buffer::<u32>(b);
    };
    let upload = |g: &mut Graph| {
        let b = g.buffer("b", 8);
        g.upload("up", b, vec![0; 12]);
    };
    let fill = |g: &mut Graph| {
        let b = g.buffer("b", 6);
        g.fill("fill", b, 0);
    };
    let copy = |g: &mut Graph| {
        let [a, b] = ["a", "b"].map(|name| g.declare_buffer(name, 8));
        g.copy_buffer("copy", (a, 0), (b, 4), 8);
    };
    let overlap = |g: &mut Graph| {
        let a = g.declare_buffer("a", 8);
        g.copy_buffer("copy", (a, 0), (a, 2), 4);
    };
    let raw = |g: &mut Graph| {
        let a = g.image("a", small());
        g.raw("build", &[(a.into(), Access::ReadWrite)], |_| {});
    };
    let say = "pass `write`, shader `test/kernel`";
    let table = [
        (
            mistake(wrong_format),
            "pass `group/write`, shader `test/kernel`, variable `dst`: image `a` is R32Float, the shader declares \
             Rgba16Float"
                .to_owned(),
        ),
        (mistake(foreign), format!("{say}, variable `dst`: the handle belongs to another graph")),
        (
            mistake(unwritten),
            "pass `read`, shader `test/kernel`, variable `src`: reads image `a`, which nothing has written before"
                .into(),
        ),
        (mistake(params), format!("{say}: 4 bytes of parameters where the shader has 0")),
        (mistake(constants), format!("{say}: 1 specialization constants where the shader has 0")),
        (mistake(groups), format!("{say}, variable `grid`: [9, 1, 1] workgroups, the device takes [8, 8, 8]")),
        (mistake(large), format!("{say}, variable `data`: buffer `b` of 8192 bytes, the device binds 4096")),
        (
            mistake(indirect),
            format!("{say}, variable `grid`: no three numbers at byte 8 of buffer `b` of 16 bytes"),
        ),
        (mistake(wide), "image `a` of 64×257 texels, the device takes 256 a side".into()),
        (mistake(long), "buffer `b` of 65537 bytes, the device takes 65536".into()),
        (mistake(empty), "image `a` has no bytes".into()),
        (
            mistake(readback),
            "pass `readback/b`, variable `source`: holds no whole number of elements of 4 bytes".into(),
        ),
        (
            mistake(readback_unwritten),
            "pass `readback/b`, variable `source`: reads buffer `b`, which nothing has written before".into(),
        ),
        (
            mistake(upload),
            "pass `up`, variable `buffer`: 12 bytes for a buffer of 8".into(),
        ),
        (mistake(fill), "pass `fill`, variable `buffer`: 6 bytes are no multiple of 4".into()),
        (mistake(copy), "pass `copy`, variable `to`: 8 bytes at byte 4 reach past the end, 8".into()),
        (mistake(overlap), "pass `copy`: copies a buffer over itself".into()),
        (mistake(raw), "pass `build`: reads image `a`, which nothing has written before".into()),
    ];
    for (found, expected) in table {
        assert_eq!(found, expected);
    }
}

#[test]
fn named_passes_check_names_kinds_and_parameters() {
    let mut code = code(&[("out_ao", IMAGE, Access::Write), ("normal", IMAGE, Access::Read)]);
    code.params_size = 16;
    let member = |name: &'static str, ty: &'static str, offset, size| ParamMember {
        name: name.into(),
        ty: ty.into(),
        offset,
        size,
    };
    code.params = Cow::Owned(vec![member("direction", "vec3", 0, 12), member("rays", "uint", 12, 4)]);
    let kernel = RuntimeKernel::new(Arc::new(code), vec![]);
    let mut g = Graph::new();
    let (ao, normal) = (g.image("ao", small()), g.declare_image("normal", small()));
    let buffer = g.declare_buffer("vpls", 64);
    let good: [(&str, AnyRes); 2] = [("normal", normal.into()), ("out_ao", ao.into())];
    let params: [(&str, ParamValue); 2] = [("rays", 3_u32.into()), ("direction", [1.0_f32, 2.0, 3.0].into())];
    let mut message = |bind: &[(&str, AnyRes)], params: &[(&str, ParamValue)]| {
        g.pass_named("ao", &kernel, bind, params, Grid::Over(ao)).unwrap_err().to_string()
    };
    let at = |variable: &str| format!(", shader `test/kernel`{variable}");
    let cases = [
        (
            message(&[("normal", normal.into()), ("out_oa", ao.into())], &params),
            at(""),
            "the shader has no variable `out_oa` (did you mean `out_ao`?); it has `out_ao`, `normal`",
        ),
        (message(&good[..1], &params), at(", variable `out_ao`"), "variable `out_ao` is not given"),
        (message(&[good[0], good[0]], &params), at(""), "variable `normal` is given twice"),
        (
            message(&[("normal", buffer.into()), good[1]], &params),
            at(", variable `normal`"),
            "the shader declares an image, `vpls` is a buffer",
        ),
        (
            message(&[("normal", ao.into()), good[1]], &params),
            at(", variable `normal`"),
            "reads image `ao`, which nothing has written before",
        ),
        (message(&good, &params[..1]), at(", variable `direction`"), "parameter `direction` is not given"),
        (
            message(&good, &[("ray", 1_u32.into()), params[1]]),
            at(""),
            "the shader has no parameter `ray` (did you mean `rays`?); it has `direction`, `rays`",
        ),
        (
            message(&good, &[("rays", 1.0_f32.into()), params[1]]),
            at(", variable `rays`"),
            "a float is given for a uint",
        ),
    ];
    for (n, (found, at, what)) in (1..).zip(cases) {
        let path = if n == 1 { "ao".to_owned() } else { format!("ao#{n}") };
        assert_eq!(found, format!("pass `{path}`{at}: {what}"));
    }
    g.pass_named("good", &kernel, &good, &params, Grid::Over(ao)).unwrap();
    let work::Work::Kernel(work) = &g.passes.last().unwrap().work else { panic!("a kernel was recorded") };
    let expected: Vec<u8> = [1.0_f32.to_bits(), 2.0_f32.to_bits(), 3.0_f32.to_bits(), 3]
        .iter()
        .flat_map(|word| word.to_ne_bytes())
        .collect();
    assert_eq!(work.params, expected);
    assert!(matches!(work.dispatch, work::Dispatch::Groups([8, 8, 1])));
}

#[test]
fn the_oracle_sees_broken_placements_and_layouts() {
    let mut g = Graph::new();
    let [a, b] = ["a", "b"].map(|name| g.image(name, small()));
    image_pass(&mut g, "first", &[], &[a]);
    image_pass(&mut g, "second", &[a], &[b]);
    g.read_image::<u8>(b);
    let plan = g.plan(&Typical).unwrap();
    check(&plan).unwrap();
    let broken = |f: fn(&mut Plan)| {
        let mut plan = plan.clone();
        f(&mut plan);
        check(&plan).unwrap_err()
    };
    let (a, b, first, second) = ("a".to_owned(), "b".to_owned(), "first".to_owned(), "second".to_owned());
    assert_eq!(
        broken(|plan| plan.resources[2].placement = plan.resources[1].placement),
        Violation::Clobbered { first: a.clone(), second: b.clone() }
    );
    assert_eq!(broken(|plan| plan.heaps[0].size -= 1), Violation::Unplaced { resource: b.clone() });
    assert_eq!(
        broken(|plan| plan.passes[0].accesses[0].reads = true),
        Violation::Unwritten { pass: first.clone(), resource: a.clone() }
    );
    assert_eq!(
        broken(|plan| plan.passes[0].barrier.as_mut().unwrap().initialise.clear()),
        Violation::Layout { pass: first.clone(), resource: a.clone(), missing: true }
    );
    assert_eq!(
        broken(|plan| plan.passes[1].barrier.as_mut().unwrap().initialise.push(1)),
        Violation::Layout { pass: second.clone(), resource: a.clone(), missing: false }
    );
    assert_eq!(
        broken(|plan| plan.passes[1].barrier.as_mut().unwrap().before = Stages::TRANSFER),
        Violation::Unordered { first, second, earlier: a.clone(), later: a }
    );
}

#[test]
fn dumps_show_passes_resources_barriers_memory_and_times() {
    let mut g = Graph::new();
    let normal = g.declare_image("normal", small());
    let [low, out] = ["low", "out \"quoted\""].map(|name| g.image(name, small()));
    g.group("indirect", |g| {
        image_pass(g, "gather", &[normal], &[low]);
        image_pass(g, "upsample", &[low, normal], &[out]);
        image_pass(g, "unused", &[low], &[out]);
    });
    g.tap("indirect/upsample:c").unwrap();
    let plan = g.plan(&Typical).unwrap();
    let times = [PassTime { path: "indirect/gather".into(), ms: Some(1.5), bands: 2 }];
    assert_eq!(
        plan.dot(&times),
        r#"digraph plan {
  rankdir=LR;
  node [fontname="sans-serif"];
  r1 [shape=ellipse peripheries=2 label="normal\nimage 64×64 Rgba16Float\nimported, passes 0..=1"];
  r2 [shape=ellipse label="low\nimage 64×64 Rgba16Float\nheap 0 at 0..32768, passes 0..=1"];
  r3 [shape=ellipse label="out \"quoted\"\nimage 64×64 Rgba16Float\nheap 0 at 32768..65536, passes 1..=2"];
  p0 [shape=box label="indirect/gather\ntest/kernel 8×8×1\ninitialise low\ninitialise out \"quoted\"\n1.500 ms"];
  r1 -> p0 [label="a"];
  p0 -> r2 [label="b"];
  p1 [shape=box label="indirect/upsample\ntest/kernel 8×8×1\nbarrier compute → compute (memory)"];
  r2 -> p1 [label="a"];
  r1 -> p1 [label="b"];
  p1 -> r3 [label="c"];
  p2 [shape=box label="tap/indirect/upsample:c\nbarrier compute → transfer (memory)"];
  r3 -> p2 [label="source"];
  c0 [shape=box style=dashed label="indirect/unused\nculled: `out \"quoted\"` reaches no readback, tap, import or kept resource from here"];
}
"#
    );
    let json = plan.json(&times);
    assert_eq!(json["passes"][0]["ms"], 1.5);
    assert_eq!(json["passes"][1]["barrier"]["before"], "compute");
    assert_eq!(json["resources"][2]["desc"]["extent"], serde_json::json!([64, 64]));
    assert_eq!(json["resources"][2]["placement"]["offset"], 0);
    assert_eq!(json["culled"][0]["path"], "indirect/unused");
    let edge = serde_json::json!({ "from": "indirect/gather", "to": "indirect/upsample", "resource": "low" });
    assert!(json["edges"].as_array().unwrap().contains(&edge));
}

#[test]
fn times_roll_up_and_miss_what_was_not_measured() {
    let time = |path: &str, ms| PassTime { path: path.into(), ms, bands: 1 };
    let tree = roll_up(&[time("a/x", Some(1.0)), time("b", Some(2.0)), time("a/y/z", None)]);
    let names: Vec<&str> = tree.children.iter().map(|node| &*node.name).collect();
    assert_eq!(names, ["a", "b"]);
    assert_eq!((tree.ms, tree.children[0].ms, tree.children[1].ms), (None, None, Some(2.0)));
    assert_eq!(tree.children[0].children[0].ms, Some(1.0));
    assert_eq!(tree.children[0].children[1].children[0].name, "z");
}

#[test]
#[should_panic(expected = "is no image of this graph")]
fn descriptions_of_foreign_images_are_refused() {
    let image = Graph::new().image("a", small());
    let _ = Graph::new().desc(image);
}

/// A raw pass runs in stages that have no name here; what waits for it alone waits for every stage.
#[test]
fn stages_of_raw_passes_are_never_dropped() {
    type S = ash::vk::PipelineStageFlags2;
    let other = Stages::bit(Stages::COUNT - 1);
    for bits in 0..1 << Stages::COUNT {
        let stages = (0..Stages::COUNT).filter(|bit| bits & (1 << bit) != 0);
        let stages = stages.fold(Stages::NONE, |all, bit| all | Stages::bit(bit));
        assert_eq!(stages.flags().contains(S::ALL_COMMANDS), stages.contains(other), "{stages}");
        assert_eq!(stages.flags().is_empty(), stages.is_empty(), "{stages}");
    }
}
