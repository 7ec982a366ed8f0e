// Where Bevy's screen-space reflections met nothing: there they left the picture as it was.
//
// Cost: one thread a pixel of the view, two loads.

#import bevy_render::view::View

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var before_texture: texture_2d<f32>;
@group(0) @binding(2) var after_texture: texture_2d<f32>;
// 1 where nothing was met.
@group(0) @binding(3) var missed: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn mark_missed(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2<u32>(view.main_pass_viewport.zw)) {
        return;
    }
    let pixel = id.xy + vec2<u32>(view.main_pass_viewport.xy);
    let same = all(textureLoad(before_texture, pixel, 0).rgb == textureLoad(after_texture, pixel, 0).rgb);
    textureStore(missed, id.xy, vec4<f32>(select(0.0, 1.0, same)));
}
