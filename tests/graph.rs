//! Graphs on the device at hand, against the same passes on the CPU.

mod common;

use parhelion::graph::{
    AnyRes, Desc, Error, Executor, Graph, Grid, Image, ImageDesc, Res, Run, RunOptions, Stages, Ticket, check,
};
use parhelion::shaders::test::{blur, count, groups, layout, noise};
use parhelion::vk::{Backend, Device, DeviceOptions, Format, MemoryKind};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const DESC: ImageDesc = ImageDesc::new([37, 21], Format::Rgba32Float);

type Texels = Vec<[f32; 4]>;

fn executor(device: &Device) -> Executor {
    Executor::new(device, Backend::Software).unwrap()
}

fn noise_pass(g: &mut Graph, name: &'static str, seed: u32, to: Res<Image>) {
    g.pass(
        name,
        &noise::kernel(),
        noise::Bind { noise: to },
        noise::Params { seed, steps: 1 },
        Grid::Over(to),
    );
}

fn blur_pass(g: &mut Graph, name: &'static str, source: Res<Image>, to: Res<Image>) {
    g.pass(name, &blur::kernel(), blur::Bind { source, blurred: to }, blur::Params {}, Grid::Over(to));
}

fn cpu_noise(seed: u32) -> Texels {
    let [width, height] = DESC.extent;
    (0..width * height)
        .map(|i| {
            let start = seed.wrapping_add(i.wrapping_mul(747_796_405));
            let state = start.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.to_le_bytes().map(f32::from)
        })
        .collect()
}

fn cpu_blur(source: &Texels) -> Texels {
    let [width, height] = DESC.extent.map(|n| n as usize);
    let sum = |i: usize| {
        let (x, y) = (i % width, i / width);
        let at = |dx, dy| source[(y + dy) % height * width + (x + dx) % width];
        let texels = [at(0, 0), at(0, 1), at(1, 0), at(1, 1)];
        std::array::from_fn(|c| texels.iter().map(|texel| texel[c]).sum())
    };
    (0..width * height).map(sum).collect()
}

/// A step of a random graph; every image is a number.
#[derive(Clone, Copy, Debug)]
enum Step {
    Noise(u32, usize),
    Blur(usize, usize),
    Copy(usize, usize),
    Clear(usize),
    Read(usize),
}

/// Steps over `images` images, the first of which has contents.
fn random_steps(images: usize, state: &mut u32) -> Vec<Step> {
    let mut written = vec![false; images];
    written[0] = true;
    let mut pick = |n: usize| {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*state >> 16) as usize % n
    };
    let mut steps = Vec::new();
    for seed in 0..14 {
        let from: Vec<usize> = (0..images).filter(|&i| written[i]).collect();
        let from = from[pick(from.len())];
        let to = pick(images);
        steps.push(match pick(8) {
            0 => Step::Clear(to),
            1 => Step::Noise(seed, to),
            2 => Step::Read(from),
            3 if from != to => Step::Copy(from, to),
            _ if from != to => Step::Blur(from, to),
            _ => Step::Noise(seed, to),
        });
        if !matches!(steps.last(), Some(Step::Read(_))) {
            written[to] = true;
        }
    }
    steps.push(Step::Read(0));
    steps
}

/// What the reads of `steps` should find; the first image begins as `first` and ends as the second result.
fn on_the_cpu(images: usize, steps: &[Step], first: &Texels) -> (Vec<Texels>, Texels) {
    let mut contents = vec![Texels::new(); images];
    contents[0].clone_from(first);
    let mut found = Vec::new();
    for &step in steps {
        match step {
            Step::Noise(seed, to) => contents[to] = cpu_noise(seed),
            Step::Blur(from, to) => contents[to] = cpu_blur(&contents[from]),
            Step::Copy(from, to) => contents[to] = contents[from].clone(),
            Step::Clear(to) => contents[to] = vec![[0.0; 4]; cpu_noise(0).len()],
            Step::Read(from) => found.push(contents[from].clone()),
        }
    }
    (found, contents.swap_remove(0))
}

#[test]
fn random_graphs_compute_what_the_cpu_does() {
    let Some((_guard, device)) = common::device() else { return };
    let mut executor = executor(&device);
    let mut state = 1;
    for round in 0..24 {
        let images = 2 + round % 6;
        let steps = random_steps(images, &mut state);
        // Imported, and used by one run after the other.
        let kept = Arc::new(device.image("kept", DESC.extent, DESC.format).unwrap());
        let mut first = cpu_noise(99);
        for (run, alias) in [(0, true), (1, false), (2, true)] {
            let mut g = Graph::new();
            let kept = g.import_image("kept", &kept);
            let mut handles = vec![kept];
            handles.extend((1..images).map(|i| g.image(format!("image {i}"), DESC)));
            if run == 0 {
                g.upload_image("first", kept, bytemuck::cast_slice(&first).to_vec());
            }
            let mut tickets = Vec::new();
            for &step in &steps {
                match step {
                    Step::Noise(seed, to) => noise_pass(&mut g, "noise", seed, handles[to]),
                    Step::Blur(from, to) => blur_pass(&mut g, "blur", handles[from], handles[to]),
                    Step::Copy(from, to) => g.copy_image("copy", handles[from], handles[to]),
                    Step::Clear(to) => g.clear_image("clear", handles[to]),
                    Step::Read(from) => tickets.push(g.read_image::<[f32; 4]>(handles[from])),
                }
            }
            let options = RunOptions { alias, submit_ms: [100.0, 0.0][round % 2], ..RunOptions::default() };
            let mut result = executor.run(g, &options).unwrap();
            check(&result.plan).unwrap();
            let found: Vec<Texels> = tickets.into_iter().map(|ticket| result.take(ticket)).collect();
            let (expected, last) = on_the_cpu(images, &steps, &first);
            assert!(found == expected, "round {round}, run {run}: {steps:?}");
            first = last;
        }
    }
}

/// Noise, blurred `n` times from image to image, so that memory can be shared.
fn chain(g: &mut Graph, n: u32) -> Res<Image> {
    let mut image = g.image("noise", DESC);
    noise_pass(g, "noise", 5, image);
    g.group("blurs", |g| {
        for i in 0..n {
            let next = g.image(format!("blurred {i}"), DESC);
            blur_pass(g, "blur", image, next);
            image = next;
        }
    });
    image
}

#[test]
fn sharing_memory_changes_no_bit() {
    let Some((_guard, device)) = common::device() else { return };
    let mut executor = executor(&device);
    let mut run = |alias| {
        let mut g = Graph::new();
        let image = chain(&mut g, 6);
        let ticket = g.read_image::<[f32; 4]>(image);
        let mut run = executor.run(g, &RunOptions { alias, ..RunOptions::default() }).unwrap();
        (run.take(ticket), run.transient_bytes, run.unaliased_bytes)
    };
    let expected = (0..6).fold(cpu_noise(5), |image, _| cpu_blur(&image));
    let (shared, small, unaliased) = run(true);
    let (apart, large, _) = run(false);
    assert!(shared == expected && apart == expected);
    assert_eq!(large, unaliased);
    assert!(3 * small < large, "{small} of {large} bytes: two images live at a time, of seven");
}

#[test]
fn bands_change_no_bit() {
    let Some((_guard, device)) = common::device() else { return };
    for size in [[256, 9, 3], [1000, 1, 1], [4, 40, 1]] {
        let invocations = size.iter().product::<u32>();
        let run = |submit_ms: f64| -> (Vec<u32>, Run) {
            let mut g = Graph::new();
            let counts = g.buffer("counts", u64::from(invocations) * 4);
            g.fill("zero", counts, 7);
            g.pass("count", &count::kernel(), count::Bind { counts }, count::Params { size }, Grid::Of(size));
            let ticket = g.read_buffer(counts);
            let mut run =
                executor(&device).run(g, &RunOptions { submit_ms, ..RunOptions::default() }).unwrap();
            (run.take(ticket), run)
        };
        let (banded, many) = run(0.0);
        let (whole, few) = run(f64::INFINITY);
        assert!(banded == vec![8; invocations as usize] && whole == banded, "{size:?}");
        let bands = |run: &Run| run.passes.iter().find(|pass| pass.path == "count").unwrap().bands;
        // No time at all is one workgroup (of each slice) a submit, but for the first band.
        let groups = size[0].div_ceil(4) * size[1];
        assert!(bands(&many) <= groups && bands(&many) + 8 > groups);
        assert!(bands(&few) < groups / 2 && few.submits < many.submits);
    }
}

#[test]
fn a_graph_that_ran_before_is_one_submit() {
    let Some((_guard, device)) = common::device() else { return };
    let mut executor = executor(&device);
    let options = RunOptions { submit_ms: f64::INFINITY, ..RunOptions::default() };
    for frame in 0..3 {
        let mut g = Graph::new();
        let image = chain(&mut g, 3);
        let ticket = g.read_image::<f32>(image);
        let mut run = executor.run(g, &options).unwrap();
        assert_eq!(run.take(ticket).len(), 4 * 37 * 21);
        if frame > 0 {
            assert_eq!(run.submits, 1);
            assert!(run.passes.iter().all(|pass| pass.bands == 1));
        }
    }
}

#[test]
fn taps_show_what_a_pass_left() {
    let Some((_guard, device)) = common::device() else { return };
    let mut g = Graph::new();
    let [a, b] = ["a", "b"].map(|name| g.image(name, DESC));
    noise_pass(&mut g, "first", 1, a);
    blur_pass(&mut g, "blur", a, b);
    noise_pass(&mut g, "second", 2, a);
    let last = g.read_image::<[f32; 4]>(a);
    let taps = ["first:noise", "blur:source", "blur:b", "second:a"].map(|spec| g.tap(spec).unwrap());
    let mut run = executor(&device).run(g, &RunOptions { submit_ms: 0.0, ..RunOptions::default() }).unwrap();
    let (one, two) = (cpu_noise(1), cpu_noise(2));
    let expected = [&one, &one, &cpu_blur(&one), &two];
    for (tap, expected) in taps.into_iter().zip(expected) {
        assert_eq!(tap.desc, Desc::Image(DESC));
        let bytes = run.take(tap.ticket);
        assert!(bytes == bytemuck::cast_slice::<_, u8>(expected));
    }
    assert!(run.take(last) == two);
}

#[test]
fn passes_that_nobody_sees_do_not_run() {
    let Some((_guard, device)) = common::device() else { return };
    let kept = Arc::new(device.upload("kept", &[1, 0, 0, 0]).unwrap());
    let mut g = Graph::new();
    let kept = g.import_buffer("kept", &kept);
    let [counts, copy] = ["counts", "copy"].map(|name| g.buffer(name, 4));
    let size = [1, 1, 1];
    g.pass("export", &count::kernel(), count::Bind { counts: kept }, count::Params { size }, Grid::Of(size));
    g.fill("zero", counts, 0);
    g.group("wasted", |g| g.copy_buffer("copy", (counts, 0), (copy, 0), 4));
    let ticket = g.read_buffer::<u32>(kept);
    let mut run = executor(&device).run(g, &RunOptions::default()).unwrap();
    assert_eq!(run.take(ticket), [2]);
    let culled: Vec<&str> = run.culled.iter().map(|culled| &*culled.path).collect();
    assert_eq!(culled, ["zero", "wasted/copy"]);
    let passes: Vec<&str> = run.passes.iter().map(|pass| &*pass.path).collect();
    assert_eq!(passes, ["export", "readback/kept"]);
    assert_eq!(run.transient_bytes, 0);
}

#[test]
fn grids_come_from_buffers() {
    let Some((_guard, device)) = common::device() else { return };
    let mut g = Graph::new();
    let arguments = g.buffer("arguments", 16);
    let counts = g.buffer("counts", 4 * 64);
    g.fill("zero", counts, 0);
    let bind = groups::Bind { arguments };
    g.pass("arguments", &groups::kernel(), bind, groups::Params { groups: [3, 2, 1] }, Grid::Of([1, 1, 1]));
    // In bands, since it is new: the last one's base must not reach the next dispatch.
    let other = g.buffer("other", 4 * 64);
    g.fill("other zero", other, 0);
    let size = [1, 64, 1];
    g.pass("banded", &count::kernel(), count::Bind { counts: other }, count::Params { size }, Grid::Of(size));
    let banded = g.read_buffer::<u32>(other);
    let grid = Grid::Indirect { buffer: arguments, offset: 4 };
    // 3×2 workgroups of 4×1 invocations, in rows of 16.
    let params = count::Params { size: [16, 4, 1] };
    g.pass("count", &count::kernel(), count::Bind { counts }, params, grid);
    let ticket = g.read_buffer::<u32>(counts);
    let mut run = executor(&device).run(g, &RunOptions::default()).unwrap();
    let barrier = run.plan.passes.iter().find(|pass| pass.path == "count").unwrap().barrier.as_ref().unwrap();
    assert!(barrier.after.contains(Stages::INDIRECT));
    let expected: Vec<u32> = (0..64).map(|i| u32::from(i % 16 < 12 && i / 16 < 2)).collect();
    assert_eq!(run.take(ticket), expected);
    assert_eq!(run.take(banded), [1; 64]);
    assert!(run.passes.iter().any(|pass| pass.path == "banded" && pass.bands > 1));
}

#[test]
fn transfers_move_the_bytes_they_say() {
    let Some((_guard, device)) = common::device() else { return };
    let mut host = device.buffer("host", 8, MemoryKind::Upload).unwrap();
    host.mapped_mut().unwrap().copy_from_slice(&[1, 2, 3, 4, 5, 6, 7, 8]);
    let (host, seen) = (Arc::new(host), Arc::new(device.buffer("seen", 8, MemoryKind::Readback).unwrap()));
    let mut g = Graph::new();
    let (host, to) = (g.import_buffer("host", &host), g.import_buffer("seen", &seen));
    let bytes = g.buffer("bytes", 16);
    g.fill("fill", bytes, 0x0908_0706);
    g.upload("upload", bytes, vec![9; 4]);
    g.copy_buffer("in", (host, 4), (bytes, 8), 4);
    g.copy_buffer("out", (host, 0), (to, 0), 8);
    let texels: Vec<u8> = (0..3 * 2 * 4).collect();
    let image = g.image("image", ImageDesc::new([3, 2], Format::Rgba8Unorm));
    let other = g.image("other", ImageDesc::new([3, 2], Format::Rgba8Unorm));
    g.upload_image("texels", image, texels.clone());
    g.copy_image("copy", image, other);
    g.clear_image("clear", image);
    let tickets = (g.read_buffer::<u8>(bytes), g.read_image::<u8>(other), g.read_image::<[u8; 4]>(image));
    let mut run = executor(&device).run(g, &RunOptions::default()).unwrap();
    assert_eq!(run.take(tickets.0), [9, 9, 9, 9, 6, 7, 8, 9, 5, 6, 7, 8, 6, 7, 8, 9]);
    assert_eq!(run.take(tickets.1), texels);
    assert_eq!(run.take(tickets.2), [[0; 4]; 6]);
    assert_eq!(seen.mapped().unwrap().unwrap(), [1, 2, 3, 4, 5, 6, 7, 8]);
}

#[test]
fn one_object_is_one_resource() {
    let Some((_guard, device)) = common::device() else { return };
    let buffer = Arc::new(device.buffer("buffer", 4, MemoryKind::Device).unwrap());
    let image = Arc::new(device.image("image", [1, 1], Format::R32Uint).unwrap());
    let mut g = Graph::new();
    let (b, i) = (g.import_buffer("one", &buffer), g.import_image("one", &image));
    assert_eq!(AnyRes::from(b), g.import_buffer("two", &buffer).into());
    assert_eq!(AnyRes::from(i), g.import_image("two", &image).into());
    assert_eq!((g.size(b), g.desc(i).extent), (4, [1, 1]));
}

#[test]
fn every_pass_is_timed_and_times_roll_up() {
    let Some((_guard, device)) = common::device() else { return };
    let mut g = Graph::new();
    let image = chain(&mut g, 2);
    let _ticket = g.read_image::<f32>(image);
    let run = executor(&device).run(g, &RunOptions::default()).unwrap();
    let tree = run.rollup();
    let names: Vec<&str> = tree.children.iter().map(|node| &*node.name).collect();
    assert_eq!(names, ["noise", "blurs", "readback"]);
    assert_eq!(tree.children[1].children.len(), 2);
    let timed = device.info().timestamps;
    assert!(run.passes.iter().all(|pass| pass.ms.is_some_and(|ms| ms >= 0.0) == timed));
    assert_eq!(tree.ms.is_some_and(|ms| ms > 0.0), timed);
    let dump = run.plan.json(&run.passes);
    assert_eq!(dump["passes"][0]["ms"].as_f64(), run.passes[0].ms);
}

#[test]
fn progress_rises_to_the_end_and_cancelling_stops() {
    let Some((_guard, device)) = common::device() else { return };
    let mut executor = executor(&device);
    let graph = || {
        let mut g = Graph::new();
        let image = chain(&mut g, 2);
        let ticket = g.read_image::<f32>(image);
        (g, ticket)
    };
    let seen = RefCell::new(Vec::new());
    let progress = |p: parhelion::graph::Progress<'_>| seen.borrow_mut().push((p.pass.to_owned(), p.done));
    let stop = AtomicBool::new(true);
    for _ in 0..2 {
        let options = RunOptions { submit_ms: 0.0, progress: Some(&progress), ..RunOptions::default() };
        executor.run(graph().0, &options).unwrap();
        let seen = std::mem::take(&mut *seen.borrow_mut());
        assert!(seen.is_sorted_by(|a, b| a.1 <= b.1), "{seen:?}");
        let (pass, done) = seen.last().unwrap();
        assert_eq!(pass, "readback/blurred 1");
        assert!((done - 1.0).abs() < 1e-9);
        let options = RunOptions { cancel: Some(&stop), ..RunOptions::default() };
        assert!(matches!(executor.run(graph().0, &options), Err(Error::Cancelled)));
    }
    let (g, ticket) = graph();
    assert_eq!(executor.run(g, &RunOptions::default()).unwrap().take(ticket).len(), 4 * 37 * 21);
}

#[test]
fn memory_is_given_back() {
    let Some((_guard, device)) = common::device() else { return };
    let mut executor = executor(&device);
    let run = |executor: &mut Executor, n| {
        let mut g = Graph::new();
        let image = chain(&mut g, n);
        let ticket = g.read_image::<[f32; 4]>(image);
        let mut run = executor.run(g, &RunOptions { alias: false, ..RunOptions::default() }).unwrap();
        assert!(run.take(ticket) == (0..n).fold(cpu_noise(5), |image, _| cpu_blur(&image)));
        device.memory().by_name.get("transients").copied().unwrap_or_default()
    };
    // Other transients in the same heap, then in a larger one, then in a much smaller one.
    let seven = run(&mut executor, 6);
    assert_eq!(run(&mut executor, 6), seven);
    assert!(run(&mut executor, 40) > seven);
    assert!(run(&mut executor, 6) <= 2 * seven);
    drop(executor);
    assert!(!device.memory().by_name.contains_key("transients"));
}

#[test]
fn what_cannot_run_says_why() {
    let Some((_guard, device)) = common::device() else { return };
    let mut executor = executor(&device);
    let mut g = Graph::new();
    let declared = g.declare_image("frame", DESC);
    noise_pass(&mut g, "noise", 1, declared);
    let error = executor.run(g, &RunOptions::default()).unwrap_err();
    assert_eq!(error.to_string(), "`frame` is declared and not imported; it cannot run");
    let limit = device.info().max_workgroup_count[1];
    if let Some(beyond) = limit.checked_add(1) {
        let mut g = Graph::new();
        let counts = g.declare_buffer("counts", 4);
        let size = [4, beyond, 1];
        g.pass("count", &count::kernel(), count::Bind { counts }, count::Params { size }, Grid::Of(size));
        let error = executor.run(g, &RunOptions::default()).unwrap_err().to_string();
        let start =
            format!("pass `count`, shader `test/count`, variable `grid`: [1, {beyond}, 1] workgroups");
        assert!(error.starts_with(&start), "{error}");
    }
    let buffer = Arc::new(device.buffer("all", 256, MemoryKind::Device).unwrap());
    let mut g = Graph::new();
    let all = g.import_buffer("all", &buffer);
    let bind = layout::Bind {
        instances: all,
        triangles: all,
        materials: all,
        textures: all,
        lights: all,
        vpls: all,
        choices: all,
        nodes: all,
        words: all,
    };
    g.pass("layout", &layout::kernel(), bind, layout::Params {}, Grid::Of([1, 1, 1]));
    let error = executor.run(g, &RunOptions::default()).unwrap_err().to_string();
    assert_eq!(error, "pass `layout`, shader `test/layout`: uses the scene, and the run has none");
}

/// Frames that build on each other: each blurs what the last one left and adds noise of its own to the chain.
fn frame(kept: &Arc<parhelion::vk::Image>, number: u32) -> (Graph, Ticket<[f32; 4]>) {
    let mut g = Graph::new();
    let kept = g.import_image("kept", kept);
    // Every fifth is another graph, so that transients and plans change under what is in flight.
    let image = chain(&mut g, if number.is_multiple_of(5) { 3 } else { 1 });
    let mixed = g.image("mixed", DESC);
    noise_pass(&mut g, "more", number, mixed);
    blur_pass(&mut g, "mix", if number.is_multiple_of(3) { image } else { mixed }, kept);
    let last = g.image("last", DESC);
    blur_pass(&mut g, "blur", kept, last);
    g.copy_image("keep", last, kept);
    let ticket = g.read_image(kept);
    (g, ticket)
}

fn kept(device: &Device) -> Arc<parhelion::vk::Image> {
    Arc::new(device.image("kept", DESC.extent, DESC.format).unwrap())
}

#[test]
fn two_runs_in_flight_equal_runs_one_by_one() {
    let Some((_guard, device)) = common::device() else { return };
    let (mut one, mut two) = (executor(&device), executor(&device));
    let (first, second) = (kept(&device), kept(&device));
    let mut in_flight = VecDeque::new();
    let mut expected = VecDeque::new();
    for number in 0..1000 {
        let options =
            RunOptions { pass_times: number % 2 == 0, alias: number % 7 != 0, ..RunOptions::default() };
        let (g, ticket) = frame(&first, number);
        expected.push_back(one.run(g, &options).unwrap().take(ticket));
        let (g, ticket) = frame(&second, number);
        in_flight.push_back((two.submit(g, &options).unwrap(), ticket));
        if in_flight.len() > 2 || number == 999 {
            for (flight, ticket) in in_flight.drain(..in_flight.len() - usize::from(number < 999) * 2) {
                assert!(flight.wait().unwrap().take(ticket) == expected.pop_front().unwrap(), "{number}");
            }
        }
    }
}

#[test]
fn what_ran_before_and_fits_is_submitted_at_once() {
    let Some((_guard, device)) = common::device() else { return };
    let mut executor = executor(&device);
    let options = RunOptions { submit_ms: f64::INFINITY, ..RunOptions::default() };
    let graph = || {
        let mut g = Graph::new();
        let image = chain(&mut g, 3);
        (g.read_image::<[f32; 4]>(image), g)
    };
    let expected = (0..3).fold(cpu_noise(5), |image, _| cpu_blur(&image));
    let (ticket, g) = graph();
    let mut unknown = executor.submit(g, &options).unwrap();
    assert!(!unknown.is_submitted());
    while !unknown.poll().unwrap() {
        std::thread::yield_now();
    }
    assert!(unknown.wait().unwrap().take(ticket) == expected);
    let (ticket, g) = graph();
    let known = executor.submit(g, &options).unwrap();
    assert!(known.is_submitted());
    let mut run = known.wait().unwrap();
    assert_eq!(run.submits, 1);
    assert!(run.take(ticket) == expected);
}

/// Bands of a run come before whatever is submitted behind it, also where that one alone is waited for.
#[test]
fn a_run_waits_for_what_is_left_of_the_one_before() {
    let Some((_guard, device)) = common::device() else { return };
    let mut executor = executor(&device);
    let mut reference = self::executor(&device);
    let banded = RunOptions { submit_ms: 0.0, ..RunOptions::default() };
    let (first, second) = (kept(&device), kept(&device));
    for given_up in [false, true] {
        let expected = [0, 1].map(|number| {
            let (g, ticket) = frame(&first, number);
            reference.run(g, &RunOptions::default()).unwrap().take(ticket)
        });
        let (g, ticket_a) = frame(&second, 0);
        let a = executor.submit(g, &banded).unwrap();
        let (g, ticket_b) = frame(&second, 1);
        let b = executor.submit(g, &RunOptions::default()).unwrap();
        assert!(!a.is_submitted() && !b.is_submitted());
        if given_up {
            // Its bands may be missing; nothing waits for them, and nothing breaks.
            drop(a);
            assert_eq!(b.wait().unwrap().take(ticket_b).len(), expected[1].len());
        } else {
            assert!(b.wait().unwrap().take(ticket_b) == expected[1]);
            assert!(a.wait().unwrap().take(ticket_a) == expected[0]);
        }
    }
}

/// Whoever stands behind a run that is given up still stands behind those before it.
#[test]
fn a_run_given_up_lets_none_overtake() {
    let Some((_guard, device)) = common::device() else { return };
    let mut executor = executor(&device);
    let banded = RunOptions { submit_ms: 0.0, ..RunOptions::default() };
    let graph = |n| {
        let mut g = Graph::new();
        let image = chain(&mut g, n);
        (g.read_image::<[f32; 4]>(image), g)
    };
    let expected = (0..6).fold(cpu_noise(5), |image, _| cpu_blur(&image));
    for held in [false, true] {
        let (first_ticket, g) = graph(6);
        let first = executor.submit(g, &banded).unwrap();
        let middle = executor.submit(graph(6).1, &banded).unwrap();
        let behind = held.then(|| executor.submit(graph(6).1, &banded).unwrap());
        drop(middle);
        let (last_ticket, g) = graph(6);
        let last = executor.submit(g, &RunOptions::default()).unwrap();
        assert!(last.wait().unwrap().take(last_ticket) == expected);
        assert!(first.is_submitted() && behind.is_none_or(|behind| behind.is_submitted()));
        assert!(first.wait().unwrap().take(first_ticket) == expected);
    }
}

#[test]
fn a_forgotten_run_owns_what_it_uses() {
    let Some((_guard, _)) = common::device() else { return };
    // Of its own: what is forgotten is never given back.
    let device = Device::open(&DeviceOptions { validation: true, ..DeviceOptions::default() }).unwrap();
    let kept = kept(&device);
    let alone = Arc::downgrade(&kept);
    let mut executor = executor(&device);
    let (g, ticket) = frame(&kept, 0);
    let expected = executor.run(g, &RunOptions::default()).unwrap().take(ticket);
    let (g, _) = frame(&kept, 0);
    let whole = RunOptions { submit_ms: f64::INFINITY, ..RunOptions::default() };
    let flight = executor.submit(g, &whole).unwrap();
    assert!(flight.is_submitted());
    std::mem::forget(flight);
    drop((kept, executor));
    assert!(alone.upgrade().is_some(), "the run holds its import");
    // The device is as good as before.
    let (g, ticket) = frame(&self::kept(&device), 0);
    assert!(self::executor(&device).run(g, &RunOptions::default()).unwrap().take(ticket) == expected);
    assert_eq!(device.validation().take(), Vec::<String>::new());
}

#[test]
fn replaced_transients_die_with_the_last_run_that_uses_them() {
    let Some((_guard, device)) = common::device() else { return };
    let bytes = || device.memory().by_name.get("transients").copied().unwrap_or_default();
    let mut executor = executor(&device);
    let mut submit = |n| {
        let mut g = Graph::new();
        let image = chain(&mut g, n);
        g.keep(image);
        executor.submit(g, &RunOptions { alias: false, ..RunOptions::default() }).unwrap()
    };
    let small = submit(2);
    let before = bytes();
    let large = submit(20);
    let both = bytes();
    assert!(both > before);
    large.wait().unwrap();
    assert_eq!(bytes(), both, "the first run still holds its own");
    small.wait().unwrap();
    assert_eq!(bytes(), both - before);
}
