// Which texel of which baked object each virtual light is on: what that sees of its object is known.
//
// Cost: see cssm/locate.wgsl; a thread a light.

#import bevy_bounce::cssm::locate::locate
#import bevy_bounce::shared::scene::NONE
#import bevy_bounce::vpl::types::{Vpl, VplHeader}

@group(0) @binding(3) var<storage, read> header: VplHeader;
@group(0) @binding(4) var<storage, read> vpls: array<Vpl>;
// Object and texel, or `NONE`.
@group(0) @binding(5) var<storage, read_write> eyes: array<vec2<u32>>;

@compute @workgroup_size(64)
fn find_eyes(@builtin(global_invocation_id) id: vec3<u32>) {
    let light = id.x;
    if light >= arrayLength(&eyes) {
        return;
    }
    var eye = vec2<u32>(NONE);
    if light < header.count {
        let found = locate(vpls[light].position, vpls[light].normal);
        eye = vec2<u32>(found.object, found.texel);
    }
    eyes[light] = eye;
}
