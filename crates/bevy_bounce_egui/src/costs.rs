//! What a frame costs: time, stage by stage, what was counted, memory.

use std::collections::BTreeMap;

use bevy::diagnostic::{Diagnostic, DiagnosticsStore, FrameTimeDiagnosticsPlugin};
use bevy::prelude::*;
use bevy::render::renderer::RenderAdapterInfo;
use bevy_bounce::{GiBudget, GlobalIllumination};
use bevy_egui::egui::{Align2, CollapsingHeader, Grid, ScrollArea, Sense, Shape, Stroke, Ui, Window, pos2};

use crate::settings::{MARGIN, WIDTH, context};
use crate::{Counted, Counts};

/// Size of a plot, points.
const PLOT: [f32; 2] = [110.0, 16.0];

/// The window with what a frame costs.
pub(crate) fn show(world: &mut World) {
    let Some(context) = context(world) else { return };
    let counted = world.resource::<Counts>().counted().unwrap_or_default();
    let adapter = world.get_resource::<RenderAdapterInfo>().map(|info| (info.name.clone(), info.device_type));
    let budgets = budgets(world);
    let diagnostics = world.resource::<DiagnosticsStore>();
    let (right, height) = (context.content_rect().right(), context.content_rect().height() - MARGIN);
    let window = Window::new("Cost").pivot(Align2::RIGHT_TOP).default_pos([right - 8.0, 8.0]);
    let window = window.default_size([WIDTH, height]).fade_in(false);
    window.show(&context, |ui| {
        ScrollArea::vertical().max_height(height).show(ui, |ui| {
            if let Some((name, _)) = &adapter {
                ui.label(name);
            }
            if adapter.is_some_and(|(_, kind)| kind == wgpu::DeviceType::Cpu) {
                ui.weak("Software adapter: stages take each other's time.");
            }
            if !budgets.is_empty() {
                heading(ui, "Budget", |ui| budgets.iter().for_each(|budget| budget.show(ui)));
            }
            heading(ui, "Time", |ui| times(ui, diagnostics));
            heading(ui, "Counts", |ui| counts(ui, &counted));
            heading(ui, "GPU memory", |ui| memory(ui, &counted.bytes));
        });
    });
}

fn heading(ui: &mut Ui, name: &str, body: impl FnOnce(&mut Ui)) {
    CollapsingHeader::new(name).default_open(true).show(ui, body);
}

/// What a camera may take, takes, and is given for it.
struct Budget {
    camera: Option<Name>,
    illumination: GlobalIllumination,
    left: GiBudget,
}

fn budgets(world: &mut World) -> Vec<Budget> {
    let mut cameras = world.query::<(Option<&Name>, &GlobalIllumination, &GiBudget)>();
    let copy = |(name, illumination, left): (Option<&Name>, &GlobalIllumination, &GiBudget)| Budget {
        camera: name.cloned(),
        illumination: illumination.clone(),
        left: *left,
    };
    cameras.iter(world).map(copy).collect()
}

impl Budget {
    fn show(&self, ui: &mut Ui) {
        if let Some(name) = &self.camera {
            ui.strong(name.as_str());
        }
        let spent = self.left.spent.map_or_else(|| "-".to_owned(), |spent| format!("{spent:.2}"));
        let may = self.illumination.budget.unwrap_or_default();
        let (stated, given) = (self.illumination.given(None), self.illumination.given(Some(&self.left)));
        Grid::new(("budget", self.camera.as_ref())).num_columns(2).striped(true).min_col_width(WIDTH / 2.0).show(
            ui,
            |ui| {
                for (name, value) in [
                    ("spent", format!("{spent} of {may:.2} ms")),
                    ("share of the quality", format!("{:.0} %", 100.0 * self.left.share)),
                    ("virtual lights", format!("{} of {}", given.vpls, stated.vpls)),
                    ("directions of the sky", format!("{} of {}", given.sky, stated.sky)),
                ] {
                    ui.label(name);
                    ui.label(value);
                    ui.end_row();
                }
            },
        );
    }
}

/// A row for the frame and one for each stage: time now, and how it went.
fn times(ui: &mut Ui, diagnostics: &DiagnosticsStore) {
    Grid::new("times").num_columns(3).striped(true).show(ui, |ui| {
        if let Some(frame) = diagnostics.get(&FrameTimeDiagnosticsPlugin::FRAME_TIME) {
            time(ui, "frame", frame);
        }
        for (stage, diagnostic) in stages(diagnostics) {
            time(ui, &stage.replace('_', " "), diagnostic);
        }
    });
}

/// What each stage of the project takes: on the GPU where that is measured, otherwise to record.
fn stages(diagnostics: &DiagnosticsStore) -> BTreeMap<&str, &Diagnostic> {
    let mut stages = BTreeMap::new();
    for clock in ["/elapsed_cpu", "/elapsed_gpu"] {
        for diagnostic in diagnostics.iter() {
            let path = diagnostic.path().as_str();
            if let Some(stage) = path.strip_prefix("render/bounce/").and_then(|path| path.strip_suffix(clock)) {
                stages.insert(stage, diagnostic);
            }
        }
    }
    stages
}

fn time(ui: &mut Ui, name: &str, diagnostic: &Diagnostic) {
    ui.label(name);
    let now = diagnostic.smoothed().or_else(|| diagnostic.value());
    ui.label(now.map_or_else(|| "-".to_owned(), |now| format!("{now:.2} ms")));
    plot(ui, &diagnostic.values().copied().collect::<Vec<f64>>(), diagnostic.get_max_history_length());
    ui.end_row();
}

/// Values from the left to the right, from zero to the highest; the hint says how high that is.
fn plot(ui: &mut Ui, values: &[f64], room: usize) {
    let (rect, response) = ui.allocate_exact_size(PLOT.into(), Sense::hover());
    let highest = values.iter().copied().fold(0.0, f64::max);
    let step = rect.width() / room.saturating_sub(1).max(1) as f32;
    let height = |value: f64| if highest > 0.0 { (value / highest) as f32 * rect.height() } else { 0.0 };
    let point = |(at, value): (usize, &f64)| pos2(rect.left() + at as f32 * step, rect.bottom() - height(*value));
    let points = values.iter().enumerate().map(point);
    let visuals = ui.visuals();
    let painter = ui.painter_at(rect.expand(1.0));
    painter.rect_filled(rect, 2.0, visuals.extreme_bg_color);
    painter.add(Shape::line(points.collect(), Stroke::new(1.0, visuals.hyperlink_color)));
    response.on_hover_text(format!("up to {highest:.2} ms"));
}

fn counts(ui: &mut Ui, counted: &Counted) {
    let row = |ui: &mut Ui, name: &str, number: u32| {
        ui.label(name);
        ui.label(number.to_string());
        ui.end_row();
    };
    Grid::new("counts").num_columns(2).striped(true).min_col_width(WIDTH / 2.0).show(ui, |ui| {
        if let Some(vpls) = counted.vpls {
            row(ui, "virtual lights", vpls);
        }
        for caches in &counted.caches {
            row(ui, "radiance caches", caches.caches);
            row(ui, "clusters merged", caches.merged);
            row(ui, "pixels with a surface", caches.pixels);
            row(ui, "pixels without a cache", caches.missing);
        }
    });
}

/// What is held on the GPU, by what it is for, and all of it.
fn memory(ui: &mut Ui, bytes: &BTreeMap<&'static str, u64>) {
    let mebibytes = |bytes: u64| format!("{:.2} MiB", bytes as f64 / f64::from(1 << 20));
    Grid::new("memory").num_columns(2).striped(true).min_col_width(WIDTH / 2.0).show(ui, |ui| {
        ui.strong("all");
        ui.strong(mebibytes(bytes.values().sum()));
        ui.end_row();
        for (name, bytes) in bytes.iter().filter(|(_, bytes)| **bytes > 0) {
            ui.label(*name);
            ui.label(mebibytes(*bytes));
            ui.end_row();
        }
    });
}
