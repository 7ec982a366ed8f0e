//! Numbers, with their ranges.

use std::ops::RangeInclusive;

use bevy::prelude::*;
use bevy::reflect::attributes::CustomAttributes;
use bevy_egui::egui::emath::Numeric;
use bevy_egui::egui::{DragValue, Response, Ui};

/// Share of a number that dragging by a point changes.
const SPEED: f64 = 0.01;

/// A number to drag, in the range that its attributes give; `None` where the value is no number.
pub(crate) fn number(
    ui: &mut Ui,
    value: &mut dyn PartialReflect,
    attributes: Option<&CustomAttributes>,
) -> Option<Response> {
    let value = value.try_as_reflect_mut()?;
    macro_rules! any_of {
        ($($number:ty),*) => {
            $(if let Some(value) = value.downcast_mut::<$number>() {
                return Some(drag(ui, value, attributes.and_then(CustomAttributes::get::<RangeInclusive<$number>>)));
            })*
        };
    }
    any_of!(f32, f64, u8, u16, u32, u64, usize, i8, i16, i32, i64, isize);
    None
}

/// A number that may be there or not, and a switch for that; switched on, it is the highest of its range. Whether it changed.
pub(crate) fn optional(ui: &mut Ui, value: &mut Option<f32>, attributes: Option<&CustomAttributes>) -> bool {
    let range = attributes.and_then(CustomAttributes::get::<RangeInclusive<f32>>);
    let first = range.map_or(1.0, |range| *range.end());
    let mut number = value.unwrap_or(first);
    let mut on = value.is_some();
    let mut changed = ui.checkbox(&mut on, "").changed();
    changed |= ui.add_enabled_ui(on, |ui| drag(ui, &mut number, range).changed()).inner;
    if changed {
        *value = on.then_some(number);
    }
    changed
}

fn drag<T: Numeric>(ui: &mut Ui, value: &mut T, range: Option<&RangeInclusive<T>>) -> Response {
    let least = if T::INTEGRAL { 0.1 } else { 1e-3 };
    let speed = (value.to_f64().abs() * SPEED).max(least);
    let drag = DragValue::new(value).speed(speed);
    match range {
        Some(range) => {
            let bounds = format!("{} to {}", range.start().to_f64(), range.end().to_f64());
            ui.add(drag.range(range.clone())).on_hover_text(bounds)
        }
        None => ui.add(drag),
    }
}
