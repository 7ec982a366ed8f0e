// Virtual lights as shading reads them: 32 bytes each, so that 2048 of them are a uniform buffer. Where all threads read the same light,
// that is the quickest way to it: once for all of them, from the constant cache.

#define_import_path bevy_bounce::vpl::compact

#import bevy_bounce::vpl::types::Vpl

/// As many as fit into WebGPU's 64 KiB of a uniform binding.
const UNIFORM_VPLS: u32 = 2048u;

struct CompactVpl {
    // World space.
    position: vec3<f32>,
    // Sum over red, green and blue, lumens.
    flux: f32,
    normal: vec3<f32>,
    // Shares of red and green in that, unorm16.
    shares: u32,
}

fn compact(vpl: Vpl) -> CompactVpl {
    let sum = vpl.flux.r + vpl.flux.g + vpl.flux.b;
    return CompactVpl(vpl.position, sum, vpl.normal, pack2x16unorm(vpl.flux.rg / max(sum, 1e-30)));
}

/// Linear RGB flux, lumens.
fn flux_of(vpl: CompactVpl) -> vec3<f32> {
    let shares = unpack2x16unorm(vpl.shares);
    return vpl.flux * vec3<f32>(shares, max(1.0 - shares.x - shares.y, 0.0));
}
