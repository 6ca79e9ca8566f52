//! Edits of a scene on a device: each redoes what [`Renderer::edit`]'s table says and no more, and the picture is that of a
//! renderer made for the scene as it then is.

mod common;

use common::{gray, quad};
use glam::{Affine3A, Quat, Vec3, vec3};
use parhelion::config::RenderConfig;
use parhelion::renderer::{
    BackendChoice, Error, Frame, FrameRequest, Invalidated, Redone, Renderer, RendererOptions, Stepper,
};
use parhelion::scene::{
    AlphaMode, Camera, Environment, Image, Instance, Light, LightKind, Material, Mesh, Scene, builtin,
};
use parhelion::vk::{Backend, Device};
use std::sync::Arc;

/// Cubes of one mesh, which move, stay and move; a shining square that moves and one that stays.
const CUBES: [usize; 3] = [1, 2, 3];
const LAMP: usize = 4;

fn at(x: f32, y: f32, z: f32) -> Affine3A {
    Affine3A::from_translation(vec3(x, y, z))
}

/// A room with all that in it.
fn room() -> (Scene, Camera) {
    let mut scene = builtin::closed_box(vec3(2.0, 1.5, 2.5), Vec3::splat(0.6), 3);
    let camera = scene.cameras[0].clone();
    scene.materials.extend([
        Material { roughness: 0.3, ..Material::diffuse("red", vec3(0.7, 0.2, 0.2)) },
        Material { emission: Vec3::splat(3.0), ..gray(0.0) },
    ]);
    // The box faces inwards.
    let mut cube = Mesh::clone(&builtin::closed_box(Vec3::splat(0.4), Vec3::ONE, 1).meshes[0]);
    cube.positions.iter_mut().for_each(|position| *position -= 0.2);
    cube.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    cube.materials.fill(1);
    let lamp = quad(vec3(-0.1, 0.0, -0.1), Vec3::X * 0.2, Vec3::Z * 0.2, 2);
    let high = quad(vec3(1.6, 1.4, 2.0), Vec3::X * 0.2, Vec3::Z * 0.2, 2);
    scene.meshes.extend([cube, lamp, high].map(Arc::new));
    let instance = |mesh, transform, moves| Instance { name: String::new(), mesh, transform, moves };
    let turned = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.6), vec3(1.4, 0.2, 0.7));
    scene.instances.extend([
        instance(1, at(0.6, 0.2, 0.6), true),
        instance(1, turned, false),
        instance(1, at(1.0, 0.9, 0.5) * Affine3A::from_scale(vec3(-0.5, 0.5, 0.8)), true),
        instance(2, at(0.5, 1.3, 1.2), true),
        instance(3, Affine3A::IDENTITY, false),
    ]);
    (scene, camera)
}

fn config(assignments: &[&str]) -> RenderConfig {
    let mut config = RenderConfig { size: [20, 15], ..common::plain() };
    for assignment in assignments {
        match assignment.strip_prefix("preset=") {
            Some(preset) => config.apply_preset(preset).unwrap(),
            None => config.apply_override(assignment).unwrap(),
        }
    }
    config
}

/// Direct light, VPLs by triangles that emit, glossy lobes and the cache.
fn plain() -> RenderConfig {
    config(&["vpl_shoot.vpls=24", "vpl_shoot.candidates=2"])
}

fn software(device: &Device, scene: Scene) -> Renderer {
    let backend = BackendChoice::Force(Backend::Software);
    Renderer::new(device, scene, &RendererOptions { backend, ..RendererOptions::default() }).unwrap()
}

fn picture(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera) -> Frame {
    renderer.render(config, camera, &FrameRequest::default()).unwrap()
}

fn structures(renderer: &Renderer) -> Vec<String> {
    renderer.structures().iter().map(|structure| structure.name.clone()).collect()
}

/// Makes an edit, whose picture must be that of a renderer made anew.
fn edited(
    renderer: &mut Renderer,
    (device, config, camera): (&Device, &RenderConfig, &Camera),
    what: &str,
    change: impl FnOnce(&mut Scene),
) -> Invalidated {
    let before = renderer.revision();
    let invalidated = renderer.edit(change).unwrap();
    assert_eq!(invalidated.pictures, renderer.revision() != before, "{what}");
    let mut fresh = software(device, renderer.scene().clone());
    assert_eq!(renderer.area(), fresh.area(), "{what}");
    assert_eq!(structures(renderer), structures(&fresh), "{what}");
    let [edited, fresh] = [renderer, &mut fresh].map(|renderer| picture(renderer, config, camera));
    assert!(edited.beauty.data.iter().any(|&v| v > 0.0), "{what}");
    assert!(edited.beauty == fresh.beauty, "{what}");
    invalidated
}

#[test]
fn an_edit_redoes_what_the_table_says() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = room();
    let mut renderer = software(&device, scene);
    // One kernel to compile each time.
    let config = config(&["method=path", "path_trace.spp=2"]);
    let all = renderer.scene_bytes();
    let mut edit = |what: &str, change: &dyn Fn(&mut Scene)| {
        edited(&mut renderer, (&device, &config, &camera), what, change)
    };
    let nothing = edit("names", &|scene| {
        scene.cameras[0].transform.translation.x += 0.1;
        scene.instances[1].name = "cube".into();
    });
    assert_eq!(nothing, Invalidated::default());

    let lights = edit("a light", &|scene| scene.lights[0].position.x += 0.3);
    assert_eq!((lights.pipelines, lights.structures), (false, Redone::Nothing));
    assert!((1..all / 4).contains(&lights.bytes), "{} of {all} bytes", lights.bytes);

    let spot = edit("a kind of light", &|scene| {
        scene.lights[0].kind = LightKind::Spot { inner: 0.5, outer: 1.2 };
    });
    assert_eq!((spot.pipelines, spot.structures), (true, Redone::Nothing));

    let colour = edit("a colour", &|scene| scene.materials[1].base_color.y = 0.6);
    assert_eq!((colour.pipelines, colour.structures), (false, Redone::Nothing));
    assert!((1..all / 4).contains(&colour.bytes), "{} of {all} bytes", colour.bytes);

    let mirror = edit("a mirror", &|scene| {
        (scene.materials[1].metallic, scene.materials[1].roughness) = (1.0, 0.0);
    });
    assert_eq!((mirror.pipelines, mirror.structures), (true, Redone::Nothing));

    let glow = edit("emission", &|scene| scene.materials[2].emission.z = 9.0);
    assert_eq!((glow.pipelines, glow.structures), (false, Redone::Nothing));
    edit("another that emits", &|scene| scene.materials[1].emission.y = 0.1);
    edit("darkness", &|scene| scene.materials[1..].iter_mut().for_each(|m| m.emission = Vec3::ZERO));
    edit("light again", &|scene| scene.materials[2].emission = Vec3::ONE);

    let moved = edit("a cube", &|scene| {
        scene.instances[CUBES[0]].transform = at(0.9, 0.4, 1.0) * Affine3A::from_rotation_x(0.4);
    });
    assert_eq!((moved.pipelines, moved.structures), (false, Redone::Top));
    let glow = edit("a lamp", &|scene| scene.instances[LAMP].transform = at(1.2, 0.8, 0.3));
    assert_eq!((glow.pipelines, glow.structures), (false, Redone::Top));
    assert!(moved.bytes < glow.bytes && glow.bytes < all / 2, "{moved:?}, {glow:?} of {all}");

    let out = edit("a cube outside", &|scene| scene.instances[CUBES[2]].transform = at(5.0, 3.0, 0.0));
    assert_eq!((out.pipelines, out.structures), (false, Redone::Top));

    let still = edit("what stays", &|scene| scene.instances[CUBES[1]].transform = at(1.4, 0.3, 0.7));
    assert_eq!((still.pipelines, still.structures), (false, Redone::All));
    assert!(still.bytes >= all, "{} of {all}", still.bytes);
    edit("a shape", &|scene| scene.mesh_mut(1).positions.iter_mut().for_each(|p| p.y *= 0.9));
    edit("a hole", &|scene| scene.materials[1].alpha_mode = AlphaMode::Mask { cutoff: 0.2 });
    edit("one less", &|scene| drop(scene.instances.remove(CUBES[1])));
    edit("glass", &|scene| scene.materials[1] = builtin_glass());
    let seen = edit("a cube of glass", &|scene| scene.instances[CUBES[0]].transform.translation.x -= 0.2);
    assert_eq!(seen.structures, Redone::Top);
    let texels = vec![[255, 0, 0, 255]];
    edit("an image", &|scene| {
        let image = Image { name: "red".into(), width: 1, height: 1, texels: texels.clone() };
        scene.images.push(image.into());
    });
    edit("a sky", &|scene| scene.environment = Some(Environment::constant(Vec3::ONE).into()));
    let grown = edit("more under the sky", &|scene| scene.instances[CUBES[0]].transform = at(9.0, 0.0, 0.0));
    assert_eq!(grown.structures, Redone::Top);
    let far = edit("far away", &|scene| scene.instances[CUBES[0]].transform = at(900.0, 0.0, 0.0));
    assert_eq!(far.structures, Redone::Top);
    let nothing = Affine3A::from_scale(Vec3::splat(1e-8));
    edit("a lamp that is hidden", &|scene| scene.instances[LAMP].transform = at(1.0, 0.8, 1.0) * nothing);
    edit("and is back", &|scene| scene.instances[LAMP].transform = at(1.0, 0.8, 1.0));
}

/// Whether what is there once is said to move shows in nothing but rounding.
#[test]
fn a_scene_that_may_move_looks_the_same() {
    let Some((_guard, device)) = common::device() else { return };
    let (mut scene, camera) = room();
    scene.instances.truncate(2);
    scene.materials[2].emission = Vec3::ZERO;
    // What has no triangle moves with it.
    scene.meshes.push(Arc::default());
    let nothing = Instance { name: String::new(), mesh: 4, transform: Affine3A::IDENTITY, moves: true };
    scene.instances.push(nothing);
    let config = config(&["preset=paper-canonical", "vpl_shoot.vpls=4"]);
    let mut may = software(&device, scene.clone());
    let apart = picture(&mut may, &config, &camera);
    let moved = may.edit(|scene| scene.instances[1].transform = at(0.7, 0.3, 0.8)).unwrap();
    assert_eq!(moved.structures, Redone::Top);
    let apart = [apart, picture(&mut may, &config, &camera)];
    for (apart, transform) in apart.iter().zip([at(0.6, 0.2, 0.6), at(0.7, 0.3, 0.8)]) {
        scene.instances[1] = Instance { transform, moves: false, ..scene.instances[1].clone() };
        scene.instances[2].moves = false;
        let still = picture(&mut software(&device, scene.clone()), &config, &camera);
        let pairs = apart.beauty.data.iter().zip(&still.beauty.data);
        let differ = pairs.filter(|(a, b)| (*a - *b).abs() > 1e-4 * b.abs().max(1e-3)).count();
        assert!(100 * differ <= still.beauty.data.len(), "{differ} of {}", still.beauty.data.len());
    }
}

fn builtin_glass() -> Material {
    let roughness = 0.0;
    Material { transmission: 1.0, metallic: 0.0, roughness, double_sided: true, ..Material::default() }
}

/// Boxes of triangles follow, too, by either way to visit them.
#[test]
fn boxes_follow_what_moves() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = room();
    for visibility in ["boxes", "boxes-inline"] {
        let config =
            config(&["preset=fast", &format!("indirect.visibility={visibility}"), "vpl_shoot.vpls=8"]);
        let mut renderer = software(&device, scene.clone());
        picture(&mut renderer, &config, &camera);
        for x in [0.8, 1.1] {
            let moved = renderer.edit(|scene| scene.instances[CUBES[0]].transform = at(x, 0.5, 0.9)).unwrap();
            let inline = visibility == "boxes-inline";
            assert_eq!(moved.structures, if inline { Redone::All } else { Redone::Top });
            let moved = picture(&mut renderer, &config, &camera);
            let mut fresh = software(&device, renderer.scene().clone());
            assert!(moved.beauty == picture(&mut fresh, &config, &camera).beauty, "{visibility}");
        }
    }
}

#[test]
fn what_is_refused_changes_nothing() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = room();
    let mut renderer = software(&device, scene);
    let config = plain();
    let expected = picture(&mut renderer, &config, &camera);
    let flat = Affine3A::from_scale(vec3(1.0, 0.0, 1.0));
    type Change = fn(&mut Scene);
    let changes: [(&str, &str, Change); 6] = [
        ("light", "lights[0]", |s| s.lights[0].intensity.x = f32::NAN),
        ("camera", "cameras[0]", |s| s.cameras[0].transform.translation.x = f32::NAN),
        ("material", "materials[1]", |s| s.materials[1].roughness = 2.0),
        ("nowhere", "instances[1] ()", |s| s.instances[1].transform.translation.x = f32::INFINITY),
        ("too far", "instances[1] ()", |s| s.instances[1].transform.translation.x = 1e30),
        ("no mesh", "instances[2] ()", |s| s.instances[2].mesh = 99),
    ];
    for (what, element, change) in changes {
        match renderer.edit(change) {
            Err(Error::Scene(error)) => assert_eq!(error.element, element, "{what}"),
            other => panic!("{what}: {other:?}"),
        }
        assert!(picture(&mut renderer, &config, &camera).beauty == expected.beauty, "{what}");
    }
    let refused = renderer.edit(|scene| scene.instances[CUBES[0]].transform = flat);
    assert!(matches!(refused, Err(Error::Scene(_))));
    // What was moved on the way is back.
    let there = renderer.edit(|scene| scene.lights[0].intensity *= 2.0).unwrap();
    assert_eq!(there.structures, Redone::Nothing);
    renderer.edit(|scene| scene.lights[0].intensity *= 0.5).unwrap();
    assert!(picture(&mut renderer, &config, &camera).beauty == expected.beauty);
}

/// There and back, beside a renderer that shares the scene and stays.
#[test]
fn renderers_do_not_see_each_others_moves() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = room();
    let mut renderer = software(&device, scene);
    let config = plain();
    let expected = picture(&mut renderer, &config, &camera);
    let mut other = Renderer::of(Arc::clone(renderer.prepared())).unwrap();
    let home = renderer.scene().instances[LAMP].transform;
    renderer.edit(|scene| scene.instances[LAMP].transform = at(1.0, 0.6, 1.0)).unwrap();
    assert!(picture(&mut renderer, &config, &camera).beauty != expected.beauty);
    assert!(picture(&mut other, &config, &camera).beauty == expected.beauty);
    renderer.edit(|scene| scene.instances[LAMP].transform = home).unwrap();
    assert!(picture(&mut renderer, &config, &camera).beauty == expected.beauty);
}

/// What is worked out of the scene once, such as how far rays go in it, is worked out again.
#[test]
fn steps_begin_anew_where_something_has_moved() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = room();
    let mut renderer = software(&device, scene);
    let config = RenderConfig { pixel_samples: 2, ..plain() };
    let mut stepper = Stepper::new(&mut renderer, &config, &camera, &[]).unwrap();
    stepper.step(&mut renderer, 1).unwrap();
    renderer.edit(|scene| scene.instances[CUBES[0]].transform = at(1.6, 0.9, 2.0)).unwrap();
    while stepper.step(&mut renderer, 1).unwrap() > 0 {}
    let stepped = stepper.picture(&mut renderer).unwrap();
    let expected = picture(&mut software(&device, renderer.scene().clone()), &config, &camera);
    assert_eq!(stepped.min_distance, expected.min_distance);
    assert!(stepped.beauty == expected.beauty);
}

/// By ray query the level over placements is built anew, and the picture is the same but where rays graze edges.
#[test]
fn ray_query_follows_what_moves() {
    let Some((_guard, device)) = common::ray_query_device() else { return };
    let (scene, camera) = room();
    let config = config(&["preset=paper-canonical", "vpl_shoot.vpls=4"]);
    let made = |scene| {
        let backend = BackendChoice::Force(Backend::RayQuery);
        Renderer::new(&device, scene, &RendererOptions { backend, ..RendererOptions::default() }).unwrap()
    };
    let mut renderer = made(scene);
    let first = picture(&mut renderer, &config, &camera);
    let moved = renderer.edit(|scene| scene.instances[CUBES[0]].transform = at(0.9, 0.5, 0.9)).unwrap();
    assert_eq!(moved.structures, Redone::Top);
    assert_eq!(structures(&renderer), ["blas", "tlas"]);
    let mut fresh = made(renderer.scene().clone());
    let [moved, fresh] = [&mut renderer, &mut fresh].map(|renderer| picture(renderer, &config, &camera));
    assert!(moved.beauty != first.beauty);
    assert!(moved.beauty == fresh.beauty);
}

/// What does not move costs nothing for what could: the scene has one level, as it always had.
#[test]
fn a_level_is_there_for_what_moves_alone() {
    let Some((_guard, device)) = common::device() else { return };
    let (mut scene, _) = room();
    let names = |scene: &Scene| structures(&software(&device, scene.clone()));
    assert_eq!(names(&scene), ["software", "software-top"]);
    scene.instances.iter_mut().for_each(|instance| instance.moves = false);
    assert_eq!(names(&scene), ["software"]);
}

/// Lights alone, in a scene far from its origin, whose coordinates kernels have about another.
#[test]
fn edits_hold_far_from_the_origin() {
    let Some((_guard, device)) = common::device() else { return };
    let (mut scene, mut camera) = room();
    let away = vec3(4000.0, 0.0, 0.0);
    scene.instances.iter_mut().for_each(|instance| instance.transform.translation += glam::Vec3A::from(away));
    scene.lights.iter_mut().for_each(|light| light.position += away);
    scene.cameras.clear();
    camera.transform.translation += glam::Vec3A::from(away);
    let mut renderer = software(&device, scene);
    assert!(renderer.origin().x > 0.0);
    let config = plain();
    let mut edit = |what: &str, change: &dyn Fn(&mut Scene)| {
        edited(&mut renderer, (&device, &config, &camera), what, change)
    };
    let light = Light { name: "second".into(), kind: LightKind::Point, ..room().0.lights[0].clone() };
    edit("a light", &|scene| {
        scene.lights.push(Light { position: away + vec3(1.0, 1.0, 1.0), ..light.clone() });
    });
    let moved = edit("a cube", &|scene| scene.instances[CUBES[0]].transform.translation.x += 0.25);
    assert_eq!(moved.structures, Redone::All);
    let glow = edit("emission", &|scene| scene.materials[2].emission.x = 5.0);
    assert_eq!(glow.structures, Redone::Nothing);
}
