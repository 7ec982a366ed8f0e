//! The panel: that it lists everything there is to set, that its widgets change what they show, and that it leaves the picture alone.

use std::ops::RangeInclusive;
use std::time::Duration;

use bevy::ecs::reflect::{AppTypeRegistry, ReflectComponent};
use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::prelude::*;
use bevy::reflect::enums::VariantInfo;
use bevy::reflect::{GetPath, TypeInfo, TypeRegistry, Typed};
use bevy_bounce::{
    GiBudget, GiGizmos, GiIsolate, GiLight, GiSettings, GlobalIllumination, Quality, Technique, VoxelizedMesh,
};
use bevy_bounce_egui::{
    BouncePanel, BouncePanelPlugin, Counts, Edited, PanelCamera, apply, components, edit, scene_rows,
};
use bevy_bounce_examples::scenes::CornellPlugin;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination};
use bevy_egui::egui::epaint::{ClippedShape, Shape};
use bevy_egui::egui::{self, Event, Modifiers, PointerButton, Pos2, RawInput, Rect, vec2};
use bevy_egui::{EguiContext, EguiManagedTextures};

/// What there is to set in a type: everything that is no struct; an enum itself, and the most that a variant holds.
fn leaves(info: &TypeInfo) -> usize {
    let of = |info: Option<&'static TypeInfo>| info.map_or(1, leaves);
    match info {
        TypeInfo::Struct(info) => info.iter().map(|field| of(field.type_info())).sum(),
        TypeInfo::TupleStruct(info) => info.iter().map(|field| of(field.type_info())).sum(),
        TypeInfo::Enum(info) => {
            let held = |variant: &VariantInfo| match variant {
                VariantInfo::Struct(variant) => variant.iter().map(|field| of(field.type_info())).sum(),
                VariantInfo::Tuple(variant) => variant.iter().map(|field| of(field.type_info())).sum(),
                VariantInfo::Unit(_) => 0,
            };
            1 + info.iter().map(held).max().unwrap_or(0)
        }
        _ => 1,
    }
}

/// Paths and ranges of all numbers below a struct.
fn numbers(info: &TypeInfo, path: &str, found: &mut Vec<(String, Option<(f64, f64)>)>) {
    let Ok(info) = info.as_struct() else { return };
    for field in info.iter() {
        let path = format!("{path}.{}", field.name());
        let float = field.get_attribute::<RangeInclusive<f32>>().map(|r| (f64::from(*r.start()), f64::from(*r.end())));
        let whole = field.get_attribute::<RangeInclusive<u32>>().map(|r| (f64::from(*r.start()), f64::from(*r.end())));
        if field.is::<f32>() || field.is::<u32>() {
            found.push((path, float.or(whole)));
        } else if let Some(info) = field.type_info() {
            numbers(info, &path, found);
        }
    }
}

/// Ranges that editors are told are those that hold.
#[test]
fn ranges_are_where_settings_are_clamped() {
    let mut found = Vec::new();
    numbers(GiSettings::type_info(), "", &mut found);
    assert!(found.len() > 8, "{found:?}");
    for (path, range) in found {
        let (low, high) = range.unwrap_or_else(|| panic!("{path} has no range"));
        for (asked, expected) in [(f64::MIN, low), (f64::MAX, high), (low, low), (high, high)] {
            let mut settings = SMALL;
            if let Ok(value) = settings.path_mut::<f32>(path.as_str()) {
                *value = asked as f32;
                // Infinities are mistakes, not wishes.
                *value = value.clamp(f32::MIN, f32::MAX);
            } else if let Ok(value) = settings.path_mut::<u32>(path.as_str()) {
                *value = asked as u32;
            }
            let held = Quality::Custom(settings).settings();
            let got = held.path::<f32>(path.as_str()).map(|value| f64::from(*value));
            let got = got.or_else(|_| held.path::<u32>(path.as_str()).map(|value| f64::from(*value)));
            let got = got.unwrap_or_else(|error| panic!("{path}: {error}"));
            assert_eq!(got, expected, "{path} at {asked}");
        }
    }
}

/// What a screen may have on it.
trait Shown {
    fn rows(&mut self, ui: &mut egui::Ui, registry: &TypeRegistry) -> Edited;
}

impl<T: PartialReflect> Shown for T {
    fn rows(&mut self, ui: &mut egui::Ui, registry: &TypeRegistry) -> Edited {
        edit(ui, registry, "value", self)
    }
}

/// The lists of what is in a world.
struct Lists(World);

impl Shown for Lists {
    fn rows(&mut self, ui: &mut egui::Ui, registry: &TypeRegistry) -> Edited {
        scene_rows(ui, &mut self.0, registry)
    }
}

/// An interface without a window, and what is in it.
struct Screen {
    context: egui::Context,
    registry: TypeRegistry,
    shapes: Vec<ClippedShape>,
}

impl Screen {
    fn new() -> Self {
        let mut registry = TypeRegistry::default();
        registry.register::<GlobalIllumination>();
        registry.register::<GiIsolate>();
        registry.register::<VoxelizedMesh>();
        registry.register::<Color>();
        registry.register::<bool>();
        Self { context: egui::Context::default(), registry, shapes: Vec::new() }
    }

    /// One frame.
    fn show(&mut self, value: &mut impl Shown, events: Vec<Event>) -> Edited {
        let screen_rect = Some(Rect::from_min_size(Pos2::ZERO, vec2(400.0, 2000.0)));
        let mut edited = Edited::default();
        let output = self.context.run_ui(RawInput { screen_rect, events, ..default() }, |ui| {
            let now = value.rows(ui, &self.registry);
            edited = Edited { shown: now.shown, changed: edited.changed || now.changed };
        });
        self.shapes = output.shapes;
        edited
    }

    /// The middle of everything that says so, from the back to the front.
    fn find(&self, text: &str) -> Vec<Pos2> {
        fn search(shape: &Shape, text: &str, found: &mut Vec<Pos2>) {
            match shape {
                Shape::Vec(shapes) => shapes.iter().for_each(|shape| search(shape, text, found)),
                Shape::Text(shape) if shape.galley.text() == text => found.push(shape.visual_bounding_rect().center()),
                _ => {}
            }
        }
        let mut found = Vec::new();
        self.shapes.iter().for_each(|clipped| search(&clipped.shape, text, &mut found));
        assert!(!found.is_empty(), "nothing says {text:?}");
        found
    }

    /// Frames until what was clicked on has opened or closed.
    fn open(&mut self, value: &mut impl Shown) {
        (0..20).for_each(|_| _ = self.show(value, Vec::new()));
    }

    /// Presses on the first number of that value, moves by so much, lets go. Whether that changed something.
    fn drag(&mut self, value: &mut impl Shown, number: &str, by: f32) -> bool {
        self.show(value, Vec::new());
        let from = self.find(number)[0];
        self.press(value, from, by)
    }

    /// On the foremost text of that kind.
    fn click(&mut self, value: &mut impl Shown, text: &str) -> bool {
        self.show(value, Vec::new());
        let at = self.find(text).pop().unwrap_or_default();
        self.press(value, at, 0.0)
    }

    fn press(&mut self, value: &mut impl Shown, from: Pos2, by: f32) -> bool {
        let button = |pos, pressed| {
            let button = PointerButton::Primary;
            Event::PointerButton { pos, button, pressed, modifiers: Modifiers::default() }
        };
        let to = from + vec2(by, 0.0);
        let mut changed = self.show(value, vec![Event::PointerMoved(from)]).changed;
        changed |= self.show(value, vec![button(from, true)]).changed;
        changed |= self.show(value, vec![Event::PointerMoved(to)]).changed;
        changed |= self.show(value, vec![button(to, false)]).changed;
        changed | self.show(value, Vec::new()).changed
    }
}

/// What is shown is what the types hold, whichever quality is chosen.
#[test]
fn every_setting_is_shown() {
    let expected = leaves(GlobalIllumination::type_info());
    assert!(expected > 18, "{expected}");
    let mut screen = Screen::new();
    for quality in [Quality::Low, Quality::Ultra, Quality::Custom(SMALL)] {
        let mut value = GlobalIllumination { quality, ..default() };
        assert_eq!(screen.show(&mut value, Vec::new()), Edited { shown: expected, changed: false });
        assert_eq!(value.quality, quality, "looking changes nothing");
    }
    let mut isolate = GiIsolate::default();
    assert_eq!(screen.show(&mut isolate, Vec::new()).shown, 1);
}

/// Choices, switches and numbers, by the mouse.
#[test]
fn widgets_change_what_they_show() {
    let mut screen = Screen::new();
    let mut value = GlobalIllumination::default();
    assert!(!screen.click(&mut value, "Medium") && value.quality == Quality::Medium, "a list opens");
    assert!(screen.click(&mut value, "High") && value.quality == Quality::High);
    screen.click(&mut value, "Instant radiosity");
    assert!(screen.click(&mut value, "Radiance cache") && value.technique == Technique::RadianceCache);

    // A value of a quality makes it one's own, with the other values as they were.
    let high = Quality::High.settings();
    assert!(screen.drag(&mut value, "4096", 30.0));
    let Quality::Custom(settings) = value.quality else { panic!("{:?}", value.quality) };
    assert!(settings.vpls > 4096 && settings == GiSettings { vpls: settings.vpls, ..high }, "{settings:?}");
    assert!(screen.click(&mut value, "glossy"));
    let Quality::Custom(settings) = value.quality else { panic!("{:?}", value.quality) };
    assert!(settings.radiance_cache.glossy);
    // Nothing is dragged out of its range.
    assert!(screen.drag(&mut value, "12", -5000.0));
    assert_eq!(value.quality.settings().bounces, 1);
    screen.click(&mut value, "Custom");
    assert!(screen.click(&mut value, "Low") && value.quality == Quality::Low);

    // What may be there or not: off, its number cannot be dragged.
    assert!(!screen.drag(&mut value, "100", -200.0) && value.budget.is_none());
    value.budget = Some(50.0);
    assert!(screen.drag(&mut value, "50.0", -20.0));
    assert!(value.budget.is_some_and(|budget| budget > 0.1 && budget < 50.0), "{value:?}");

    let mut isolate = GiIsolate::All;
    screen.click(&mut isolate, "All");
    assert!(screen.click(&mut isolate, "Residual") && isolate == GiIsolate::Residual);
}

/// Lights and meshes by name: what is changed is on the entity, and nowhere before.
#[test]
fn lights_and_meshes_are_set_one_by_one() {
    let mut screen = Screen::new();
    let mut scene = Lists(World::new());
    let lamp = scene.0.spawn((SpotLight::default(), Name::new("lamp"))).id();
    let wall = scene.0.spawn((Mesh3d::default(), Name::new("wall"))).id();
    (0..60).for_each(|_| _ = scene.0.spawn(Mesh3d::default()));
    screen.click(&mut scene, "Lights (1)");
    assert!(!screen.click(&mut scene, &format!("lamp {lamp}")), "looking changes nothing");
    assert_eq!(screen.show(&mut scene, Vec::new()).shown, leaves(GiLight::type_info()));
    assert_eq!(scene.0.get::<GiLight>(lamp), None);
    assert!(screen.drag(&mut scene, "1.00", 50.0));
    let set = scene.0.get::<GiLight>(lamp).expect("is there once it is set");
    assert!(set.intensity > 1.0 && *set == GiLight { intensity: set.intensity, ..default() }, "{set:?}");

    screen.click(&mut scene, "Lights (1)");
    screen.click(&mut scene, "Meshes (61)");
    screen.open(&mut scene);
    screen.find("and 11 more: look for them by name");
    let field = screen.find("name")[0] + vec2(60.0, 0.0);
    screen.press(&mut scene, field, 0.0);
    screen.show(&mut scene, vec![Event::Text("WALL".to_owned())]);
    screen.open(&mut scene);
    screen.click(&mut scene, &format!("wall {wall}"));
    screen.open(&mut scene);
    assert_eq!(screen.find("enabled").len(), 1);
    assert!(screen.click(&mut scene, "enabled"));
    assert_eq!(scene.0.get::<VoxelizedMesh>(wall), Some(&VoxelizedMesh { enabled: false, ..default() }));
}

/// What may be there or not, and colours.
#[test]
fn an_albedo_is_chosen() {
    let mut screen = Screen::new();
    let mut mesh = VoxelizedMesh::default();
    let without = screen.show(&mut mesh, Vec::new()).shown;
    assert_eq!(without, 3);
    screen.click(&mut mesh, "None");
    assert!(screen.click(&mut mesh, "Some"));
    let chosen = [mesh.albedo.is_some(), mesh.two_sided.is_some()];
    assert!(chosen == [true, false] || chosen == [false, true], "{mesh:?}");
    mesh = VoxelizedMesh { albedo: Some(Color::WHITE), two_sided: Some(false), ..default() };
    assert_eq!(screen.show(&mut mesh, Vec::new()), Edited { shown: 5, changed: false });
}

fn cornell(panel: Option<BouncePanelPlugin>) -> Stage {
    Stage::new(UVec2::new(96, 54), SMALL, |app| {
        app.add_plugins(CornellPlugin);
        if let Some(panel) = panel {
            app.add_plugins(panel);
        }
    })
}

fn press(stage: &mut Stage, key_code: KeyCode, state: ButtonState) {
    let (logical_key, window) = (Key::F1, Entity::PLACEHOLDER);
    stage.world().write_message(KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window });
}

/// The key opens it over the picture, whose light it does not touch; closed, nothing of it is left.
#[test]
fn the_panel_opens_over_the_picture_and_leaves_nothing_behind() {
    let (mut plain, mut stage) = (cornell(None), cornell(Some(BouncePanelPlugin::default())));
    let light = plain.settled_picture();
    let shown = plain.display();
    let closed = |stage: &mut Stage| {
        assert!(light == stage.settled_picture() && shown == stage.display(), "a closed panel shows");
        let mut contexts = stage.world().query_filtered::<(), Or<(With<EguiContext>, With<PanelCamera>)>>();
        assert_eq!(contexts.iter(stage.world()).count(), 0, "a closed panel has a context");
        assert!(stage.world().resource::<EguiManagedTextures>().is_empty(), "a closed panel holds textures");
        assert_eq!(stage.world().resource::<BouncePanel>().settings, 0);
    };
    closed(&mut stage);
    assert!(stage.world().resource::<Counts>().counted().is_none(), "a closed panel counts");
    for _ in 0..2 {
        press(&mut stage, KeyCode::F1, ButtonState::Pressed);
        stage.frame(Duration::ZERO);
        press(&mut stage, KeyCode::F1, ButtonState::Released);
        assert!(light == stage.settled_picture(), "the panel changes the light");
        let differs = stage.display().iter().zip(&shown).filter(|(a, b)| a != b).count();
        assert!(differs > shown.len() / 10, "the panel does not show: {differs} of {} bytes", shown.len());
        let types = [GlobalIllumination::type_info(), GiIsolate::type_info(), GiGizmos::type_info()];
        let expected = types.map(leaves).iter().sum::<usize>();
        assert_eq!(stage.world().resource::<BouncePanel>().settings, expected);
        let counted = stage.world().resource::<Counts>().counted().expect("an open panel counts");
        assert!(counted.vpls.is_some_and(|vpls| vpls > 0 && vpls <= SMALL.vpls), "{counted:?}");
        assert!(counted.bytes.values().sum::<u64>() > 1 << 20 && counted.caches.is_empty(), "{counted:?}");
        press(&mut stage, KeyCode::F1, ButtonState::Pressed);
        stage.frame(Duration::ZERO);
        press(&mut stage, KeyCode::F1, ButtonState::Released);
        closed(&mut stage);
    }
}

/// What widgets change reaches the component, and with it the picture.
#[test]
fn what_is_set_reaches_the_camera() {
    let mut stage = cornell(Some(BouncePanelPlugin { open: true, ..default() }));
    let camera = stage.only::<Camera3d>();
    let before = stage.settled_picture();
    let registry = stage.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let found = components(stage.world(), &registry, camera);
    let names: Vec<&str> = found.iter().map(|component| component.reflect_short_type_path()).collect();
    assert_eq!(names, ["GiIsolate", "GlobalIllumination"]);

    let wanted = illumination(GiSettings { bounces: 1, ..SMALL });
    apply(stage.world(), &registry, camera, &wanted);
    assert_eq!(stage.world().get::<GlobalIllumination>(camera), Some(&wanted));
    assert!(before != stage.settled_picture(), "a setting does not show");
    apply(stage.world(), &registry, camera, &illumination(SMALL));
    assert!(before == stage.settled_picture(), "a setting left something behind");
}

/// The same without the panel: by the names of types and fields alone.
#[test]
fn settings_are_within_reach_of_reflection() {
    let mut stage = cornell(None);
    let camera = stage.only::<Camera3d>();
    let registry = stage.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let registered = registry.get_with_type_path("bevy_bounce::settings::GlobalIllumination").expect("is registered");
    let reflected = registered.data::<ReflectComponent>().expect("is a component");
    let mut component = reflected.reflect_mut(stage.world().entity_mut(camera)).expect("is on the camera");
    *component.path_mut::<u32>(".quality.0.vpls").expect("is a field") = 300;
    assert_eq!(stage.world().get::<GlobalIllumination>(camera), Some(&illumination(GiSettings { vpls: 300, ..SMALL })));
}

/// A camera with a budget: the panel says what is left of the quality, and does not offer that as a setting.
#[test]
fn a_budget_is_no_setting() {
    let folder = std::env::var_os("BOUNCE_PICTURES");
    let size = if folder.is_some() { UVec2::new(360, 540) } else { UVec2::new(96, 144) };
    let mut stage = Stage::new(size, SMALL, |app| {
        app.add_plugins((CornellPlugin, BouncePanelPlugin { open: true, ..default() }));
    });
    let camera = stage.only::<Camera3d>();
    (0..3).for_each(|_| stage.frame(Duration::ZERO));
    let without = stage.world().resource::<BouncePanel>().settings;
    stage.light_by(GlobalIllumination { budget: Some(100.0), ..illumination(SMALL) });
    (0..12).for_each(|_| stage.frame(Duration::ZERO));
    assert!(stage.world().get::<GiBudget>(camera).is_some());
    assert_eq!(stage.world().resource::<BouncePanel>().settings, without);
    if let Some(folder) = folder {
        let picture = image::RgbaImage::from_vec(size.x, size.y, stage.display()).expect("four bytes a pixel");
        picture.save(std::path::Path::new(&folder).join("panel.png")).expect("can be written");
    }
}
