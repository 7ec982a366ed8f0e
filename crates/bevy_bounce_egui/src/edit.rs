//! Any reflected value as rows of an interface: what its type tells is all that is known here.

use bevy::prelude::*;
use bevy::reflect::attributes::CustomAttributes;
use bevy::reflect::enums::{DynamicEnum, DynamicVariant, VariantInfo};
use bevy::reflect::structs::DynamicStruct;
use bevy::reflect::tuple::DynamicTuple;
use bevy::reflect::{NamedField, ReflectKind, ReflectMut, ReflectRef, TypeInfo, TypeRegistry};
use bevy_bounce::Quality;
use bevy_egui::egui::{Align, CollapsingHeader, ComboBox, Layout, Response, Ui};

use crate::number::{number, optional};

/// What [`edit`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Edited {
    /// Settings that were shown: numbers, switches, choices.
    pub shown: usize,
    /// Whether one was changed.
    pub changed: bool,
}

impl Edited {
    fn one(changed: bool) -> Self {
        Self { shown: 1, changed }
    }

    pub(crate) fn and(self, other: Self) -> Self {
        Self { shown: self.shown + other.shown, changed: self.changed || other.changed }
    }
}

/// What is known of a value from where it stands.
#[derive(Clone, Copy)]
struct Field<'a> {
    name: &'a str,
    docs: Option<&'a str>,
    attributes: Option<&'a CustomAttributes>,
}

/// Shows `value` under `name` and lets the user change it: structs as headings with their fields, enums as choices, numbers to
/// drag, switches, colours. Documentation is shown as hints. A choice with values of its own is offered where the registry has defaults
/// for them.
///
/// A [`Quality`] shows the settings behind it; changing one makes it [`Quality::Custom`].
pub fn edit(ui: &mut Ui, registry: &TypeRegistry, name: &str, value: &mut dyn PartialReflect) -> Edited {
    let docs = value.get_represented_type_info().and_then(TypeInfo::docs);
    value_rows(ui, registry, Field { name, docs, attributes: None }, value)
}

fn value_rows(ui: &mut Ui, registry: &TypeRegistry, field: Field, value: &mut dyn PartialReflect) -> Edited {
    if let Some(quality) = value.try_downcast_mut::<Quality>() {
        return quality_rows(ui, registry, field, quality);
    }
    if let Some(value) = value.try_downcast_mut::<Option<f32>>() {
        let changed = labelled(ui, field, |ui| optional(ui, value, field.attributes));
        return Edited { shown: 2, changed };
    }
    if let Some(color) = value.try_downcast_mut::<Color>() {
        return Edited::one(labelled(ui, field, |ui| pick(ui, color)));
    }
    let info = value.get_represented_type_info();
    match value.reflect_kind() {
        ReflectKind::Struct => {
            let heading = CollapsingHeader::new(title(field.name)).default_open(true);
            let response = heading.show(ui, |ui| fields(ui, registry, value));
            hint(response.header_response, field.docs);
            response.body_returned.unwrap_or_default()
        }
        ReflectKind::Enum => {
            let chosen = choice(ui, registry, field, info, value);
            chosen.and(ui.indent(field.name, |ui| fields(ui, registry, value)).inner)
        }
        ReflectKind::TupleStruct | ReflectKind::Tuple => fields(ui, registry, value),
        _ => leaf(ui, field, value),
    }
}

/// A colour to choose, without alpha. Whether it was changed.
fn pick(ui: &mut Ui, color: &mut Color) -> bool {
    let LinearRgba { red, green, blue, alpha } = color.to_linear();
    let mut picked = [red, green, blue];
    let changed = ui.color_edit_button_rgb(&mut picked).changed();
    if changed {
        let [red, green, blue] = picked;
        *color = LinearRgba { red, green, blue, alpha }.into();
    }
    changed
}

/// The settings behind a quality are its own once one is changed.
fn quality_rows(ui: &mut Ui, registry: &TypeRegistry, field: Field, quality: &mut Quality) -> Edited {
    let mut settings = quality.settings();
    let chosen = choice(ui, registry, field, quality.get_represented_type_info(), quality);
    if chosen.changed {
        if matches!(quality, Quality::Custom(_)) {
            *quality = Quality::Custom(settings);
        }
        settings = quality.settings();
    }
    let edited = ui.indent(field.name, |ui| fields(ui, registry, &mut settings)).inner;
    if edited.changed {
        *quality = Quality::Custom(settings);
    }
    chosen.and(edited)
}

/// What a struct, a tuple or the present variant of an enum holds.
fn fields(ui: &mut Ui, registry: &TypeRegistry, value: &mut dyn PartialReflect) -> Edited {
    let info = value.get_represented_type_info();
    let mut edited = Edited::default();
    let alone = matches!(value.reflect_ref(), ReflectRef::Enum(value) if value.field_len() == 1);
    let mut row = |ui: &mut Ui, at: usize, name: Option<&str>, value: &mut dyn PartialReflect, told: Option<Field>| {
        // The only value of a choice goes by the name of that.
        let number = if alone { String::new() } else { at.to_string() };
        let field = told.unwrap_or(Field { name: name.unwrap_or(&number), docs: None, attributes: None });
        edited = edited.and(ui.push_id(at, |ui| value_rows(ui, registry, field, value)).inner);
    };
    match value.reflect_mut() {
        ReflectMut::Struct(value) => {
            let info = info.and_then(|info| info.as_struct().ok());
            for at in 0..value.field_len() {
                let told = info.and_then(|info| info.field_at(at)).map(named);
                let name = value.name_at(at).map(str::to_owned);
                if let Some(value) = value.field_at_mut(at) {
                    row(ui, at, name.as_deref(), value, told);
                }
            }
        }
        ReflectMut::TupleStruct(value) => {
            (0..value.field_len()).for_each(|at| {
                if let Some(value) = value.field_mut(at) {
                    row(ui, at, None, value, None);
                }
            });
        }
        ReflectMut::Tuple(value) => {
            (0..value.field_len()).for_each(|at| {
                if let Some(value) = value.field_mut(at) {
                    row(ui, at, None, value, None);
                }
            });
        }
        ReflectMut::Enum(value) => {
            let variant = info.and_then(|info| info.as_enum().ok()).and_then(|info| info.variant(value.variant_name()));
            for at in 0..value.field_len() {
                let told = match variant {
                    Some(VariantInfo::Struct(variant)) => variant.field_at(at).map(named),
                    _ => None,
                };
                let name = value.name_at(at).map(str::to_owned);
                if let Some(value) = value.field_at_mut(at) {
                    row(ui, at, name.as_deref(), value, told);
                }
            }
        }
        _ => {}
    }
    edited
}

fn named(field: &'static NamedField) -> Field<'static> {
    Field { name: field.name(), docs: field.docs(), attributes: Some(field.custom_attributes()) }
}

/// The variants of an enum.
fn choice(
    ui: &mut Ui,
    registry: &TypeRegistry,
    field: Field,
    info: Option<&'static TypeInfo>,
    value: &mut dyn PartialReflect,
) -> Edited {
    let ReflectMut::Enum(current) = value.reflect_mut() else { return Edited::default() };
    let (present, index) = (current.variant_name().to_owned(), current.variant_index());
    let variants = info.and_then(|info| info.as_enum().ok());
    let mut chosen = index;
    labelled(ui, field, |ui| {
        let combo = ComboBox::from_id_salt(field.name).selected_text(title(&present));
        let shown = combo.show_ui(ui, |ui| {
            for (at, variant) in variants.iter().flat_map(|variants| variants.iter()).enumerate() {
                let possible = at == index || values(registry, variant).is_some();
                ui.add_enabled_ui(possible, |ui| {
                    hint(ui.selectable_value(&mut chosen, at, title(variant.name())), variant.docs());
                });
            }
        });
        hint(shown.response, variants.and_then(|variants| variants.variant_at(index)).and_then(VariantInfo::docs));
    });
    let variant = variants.and_then(|variants| variants.variant_at(chosen)).filter(|_| chosen != index);
    let Some((variant, values)) = variant.and_then(|variant| Some((variant, values(registry, variant)?))) else {
        return Edited::one(false);
    };
    Edited::one(value.try_apply(&DynamicEnum::new_with_index(chosen, variant.name(), values)).is_ok())
}

/// What a variant holds at first, by the defaults of its fields.
fn values(registry: &TypeRegistry, variant: &VariantInfo) -> Option<DynamicVariant> {
    let default = |id| Some(registry.get_type_data::<ReflectDefault>(id)?.default().into_partial_reflect());
    Some(match variant {
        VariantInfo::Unit(_) => DynamicVariant::Unit,
        VariantInfo::Tuple(variant) => {
            let mut values = DynamicTuple::default();
            for field in variant.iter() {
                values.insert_boxed(default(field.type_id())?);
            }
            DynamicVariant::Tuple(values)
        }
        VariantInfo::Struct(variant) => {
            let mut values = DynamicStruct::default();
            for field in variant.iter() {
                values.insert_boxed(field.name(), default(field.type_id())?);
            }
            DynamicVariant::Struct(values)
        }
    })
}

/// A switch or a number; anything else is shown as it is.
fn leaf(ui: &mut Ui, field: Field, value: &mut dyn PartialReflect) -> Edited {
    if let Some(on) = value.try_downcast_mut::<bool>() {
        let switch = ui.checkbox(on, title(field.name));
        let changed = switch.changed();
        hint(switch, field.docs);
        return Edited::one(changed);
    }
    let changed = labelled(ui, field, |ui| match number(ui, value, field.attributes) {
        Some(response) => response.changed(),
        None => {
            ui.label(format!("{value:?}"));
            false
        }
    });
    Edited::one(changed)
}

/// A row: the name on the left, what it stands for on the right.
fn labelled<R>(ui: &mut Ui, field: Field, right: impl FnOnce(&mut Ui) -> R) -> R {
    let row = ui.horizontal(|ui| {
        hint(ui.label(title(field.name)), field.docs);
        ui.with_layout(Layout::right_to_left(Align::Center), right).inner
    });
    row.inner
}

fn hint(response: Response, docs: Option<&str>) {
    if let Some(docs) = docs {
        response.on_hover_text(docs.trim());
    }
}

/// `edge_solid_angle` and `RadianceCache` as one reads them.
pub(crate) fn title(name: &str) -> String {
    let mut title = String::with_capacity(name.len() + 4);
    for letter in name.chars() {
        let begins_word = letter.is_uppercase() && title.ends_with(char::is_lowercase);
        if begins_word {
            title.push(' ');
        }
        match letter {
            '_' => title.push(' '),
            _ if begins_word => title.extend(letter.to_lowercase()),
            _ => title.push(letter),
        }
    }
    title
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_readable() {
        for (name, expected) in [
            ("edge_solid_angle", "edge solid angle"),
            ("RadianceCache", "Radiance cache"),
            ("None", "None"),
            ("GiIsolate", "Gi isolate"),
        ] {
            assert_eq!(title(name), expected);
        }
    }
}
