// Light that a point receives from the texels of all baked objects: cuts through their hierarchies, chosen while they
// are walked through without a stack, and summed. Ritschel, Grosch, Kautz and Seidel 2008, 4.3, figure 10; bounds as in
// lightcuts (Walter et al. 2005).
//
// A node is refined where the light that could come from it, if all of it stood and faced as favourably as its sphere and its
// cone allow, is more than the threshold; for a glossy receiver, with what it mirrors. A node that is not refined sends its light
// from one of its texels, another one for each receiver, chosen in proportion to what the texels send and divided by that chance: so
// the mean over receivers is that of all texels one by one, wherever the bright ones of them lie and whatever hides the dark ones.
//
// What hides a sender is asked of the cube map of the sender, then of that of the receiver if it is on another object, then of the
// maps from outside of all others. Section 3.3.
//
// With `SEVERAL` there are several objects; without it the queries that only those need are left out.
//
// Each hierarchy is walked in its own object's space: radiance, and area over distance squared, are the same in any. The tree over the
// objects, which is walked first, is in the world's.
//
// Cost: a node visited about 50 operations, a node of the cut a query of visibility and a read for each level below it; with several
// objects, a query more and one for each further object whose sphere is in the way.

#define_import_path bevy_bounce::cssm::gather

#import bevy_bounce::cssm::query::visibility
#import bevy_bounce::cssm::texels::{bakes, half_side, load_texel, scale_of, to_object, to_world, turn_to_object, Texel}
#import bevy_bounce::cssm::tree::{unpack_node, node_count, Node}
#import bevy_bounce::cssm::types::CssmGather
#import bevy_bounce::shared::sampling::{hash, unit_float, PI}
#ifdef SEVERAL
#import bevy_bounce::cssm::query::{between_candidates, is_hidden, is_in_open, sight, Objects, STRAIGHT}
#import bevy_bounce::cssm::tree::{top_node_count, top_place}
#import bevy_bounce::shared::scene::NONE
#endif
#ifdef GLOSSY
#import bevy_bounce::cssm::lobe::{largest_weight, lobe_weight, make_lobe, Lobe}
#endif

/// Of each object its nodes, then the texels of the leaves, four at a time.
@group(0) @binding(2) var<storage, read> tree: array<vec4<u32>>;
/// Of each node, two for a place of light, then of those over the objects: sum of radiance times area, and of the area.
@group(0) @binding(3) var<storage, read> powers: array<vec4<f32>>;
@group(0) @binding(4) var<uniform> settings: CssmGather;

/// Square of the distance, in areas of a texel, within which the texel's shape counts.
const NEAR: f32 = 16.0;

/// The golden ratio's fraction, of 2^32: multiples of it are evenly spread.
const GOLDEN_RATIO: u32 = 0x9e3779b9u;

/// A place of the world that receives light.
struct Receiver {
    position: vec3<f32>,
    normal: vec3<f32>,
#ifdef SEVERAL
    /// The baked object that it is on, or `NONE`.
    object: u32,
    /// The texel that it is on.
    texel: Texel,
#endif
#ifdef GLOSSY
    /// Towards the eye.
    view: vec3<f32>,
    /// Perceptual.
    roughness: f32,
    /// Largest reflectance, of its colours, straight on.
    f_zero: f32,
#endif
}

// The same in an object's space.
struct Local {
    object: u32,
    position: vec3<f32>,
    normal: vec3<f32>,
#ifdef SEVERAL
    /// What may stand between it and the object.
    between: Objects,
#endif
#ifdef GLOSSY
    lobe: Lobe,
#endif
}

struct Gathered {
    /// Irradiance over pi, cd/m^2.
    light: vec3<f32>,
    /// Nodes of the cut.
    cut: u32,
#ifdef GLOSSY
    /// Radiance convolved with the receiver's lobe, cd/m^2.
    glossy: vec3<f32>,
#endif
}

fn leaf_texel(object: u32, rank: u32) -> u32 {
    return tree[bakes.objects[object].first_node + node_count(object) + rank / 4u][rank % 4u];
}

// Cosine of an angle, of which `cosine` is that and `slack` that of how much smaller it may be.
fn widened_cosine(cosine: f32, slack: f32) -> f32 {
    if cosine >= slack {
        return 1.0;
    }
    return cosine * slack + sqrt(max(1.0 - cosine * cosine, 0.0) * max(1.0 - slack * slack, 0.0));
}

// Light that a node's power brings at most, per unit; negative where nothing of it can be received, and infinite where the
// receiver is among the texels.
fn largest_transfer(node: Node, local: Local) -> f32 {
    let way = node.center - local.position;
    let square = dot(way, way);
    let distance = sqrt(square);
    if distance <= node.radius * 1.0001 {
        return 1e30;
    }
    let direction = way / distance;
    // Half the angle under which the sphere is seen.
    let sine = node.radius / distance;
    let cosine = sqrt(max(1.0 - sine * sine, 0.0));
    let receiver = widened_cosine(dot(local.normal, direction), cosine);
    // The cone of normals and that angle together.
    let cone_sine = sqrt(max(1.0 - node.cosine * node.cosine, 0.0));
    var sender = 1.0;
    if sine * node.cosine + cosine * cone_sine >= 0.0 {
        sender = widened_cosine(-dot(node.axis, direction), cosine * node.cosine - sine * cone_sine);
    }
    if receiver <= 0.0 || sender <= 0.0 {
        return -1.0;
    }
    var received = receiver / PI;
#ifdef GLOSSY
    received += local.lobe.reflected * largest_weight(local.lobe, direction, cosine);
#endif
    let nearest = distance - node.radius;
    return received * sender / (nearest * nearest);
}

// Lambert's sum over the edges of a polygon: the edge between two directions.
fn edge(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    let normal = cross(a, b);
    let sine = length(normal);
    return normal * select(1.0, atan2(sine, dot(a, b)) / sine, sine > 1e-6);
}

// Form factor of a square of that area and normal whose middle is `way` from the receiver. Lambert 1760.
fn square_form_factor(way: vec3<f32>, normal: vec3<f32>, area: f32, receiver: vec3<f32>) -> f32 {
    let across = half_side(normal, area);
    let up = cross(normal, across);
    let a = normalize(way - across - up);
    let b = normalize(way + across - up);
    let c = normalize(way + across + up);
    let d = normalize(way - across + up);
    let sum = edge(a, b) + edge(b, c) + edge(c, d) + edge(d, a);
    return max(-dot(sum, receiver) / (2.0 * PI), 0.0);
}

#ifdef SEVERAL
// Share of a receiver that a texel of an object sees.
fn shared_view(texel: Texel, local: Local, receiver: Receiver) -> f32 {
    let filtered = settings.filtered != 0u;
    var seen = visibility(local.object, texel, local.position, filtered);
    if receiver.object != local.object {
        if !is_in_open(local.object, texel, local.position) {
            return 0.0;
        }
        if receiver.object != NONE {
            let place = to_object(receiver.object, to_world(local.object, texel.position));
            seen *= sight(receiver.object, receiver.texel, place, filtered);
        }
    }
    if seen > 0.0 && is_hidden(to_world(local.object, texel.position), receiver.position, local.between, STRAIGHT) {
        return 0.0;
    }
    return seen;
}
#else
// Share of a receiver that a texel of the only object sees.
fn shared_view(texel: Texel, local: Local, receiver: Receiver) -> f32 {
    return visibility(local.object, texel, local.position, settings.filtered != 0u);
}
#endif

// A texel below a node, by its leaf.
struct Sender {
    /// Its place among the object's nodes, and in the order of leaves.
    node: u32,
    rank: u32,
}

// What texels are chosen by: no channel of a texel's light is more.
fn brightness(power: vec4<f32>) -> f32 {
    return power.r + power.g + power.b;
}

// One of the texels below a node, in proportion to what they send, by a place from 0 to the node's brightness. Walter et al. 2005, 3.1.
fn choose_sender(first_power: u32, node: u32, rank: u32, texels: u32, place: f32) -> Sender {
    var sender = Sender(node, rank);
    var left = texels;
    var rest = place;
    while left > 1u {
        let half = (left + 1u) / 2u;
        let first = brightness(powers[first_power + sender.node + 1u]);
        if rest < first {
            sender.node += 1u;
            left = half;
        } else {
            rest -= first;
            sender.node += 2u * half;
            sender.rank += half;
            left -= half;
        }
    }
    return sender;
}

#ifdef GLOSSY
// Steps of a sequence that covers a square evenly, of 2^32. Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences".
const EVEN_STEPS: vec2<u32> = vec2<u32>(0xc13fa9a9u, 0x91e10da5u);

// A place of a texel, from its middle. Section 4.5 of the paper; in the first turn the middle.
fn jitter(texel: Texel, turn: u32, seed: u32) -> vec3<f32> {
    if turn == 0u {
        return vec3<f32>(0.0);
    }
    let start = vec2<u32>(hash(seed), hash(~seed)) + turn * EVEN_STEPS;
    let place = 2.0 * vec2<f32>(unit_float(start.x), unit_float(start.y)) - 1.0;
    let across = half_side(texel.normal, texel.area);
    return place.x * across + place.y * cross(texel.normal, across);
}
#endif

// Adds light from a texel that sends that power, its own and that of those it stands for.
fn add_transfer(
    result: ptr<function, Gathered>,
    index: u32,
    power: vec3<f32>,
    local: Local,
    receiver: Receiver,
    seed: u32,
    turn: u32,
) {
    let texel = load_texel(local.object, index);
    let way = texel.position - local.position;
    let square = dot(way, way);
    let sender = -dot(texel.normal, way);
    if sender <= 0.0 {
        return;
    }
    // Of a disc of the texel's area, faced from its axis; of a square where that would not do.
    let disc = sender * texel.area / (square * (PI * square + texel.area));
    var form_factor = max(dot(local.normal, way), 0.0) * disc;
    if square < NEAR * texel.area {
        form_factor = square_form_factor(way, texel.normal, texel.area, local.normal);
    }
    if form_factor <= 0.0 {
        return;
    }
    let radiance = power * (shared_view(texel, local, receiver) / texel.area);
    (*result).light += radiance * form_factor;
#ifdef GLOSSY
    let solid_angle = PI * disc * sqrt(square);
    let direction = normalize(way + jitter(texel, turn, seed ^ hash(index)));
    // Of the mean of many frames variance and bias vanish together. Knaus and Zwicker 2011, "Progressive Photon Mapping: A Probabilistic
    // Approach", with alpha at 2/3.
    let spread = solid_angle / pow(f32(turn + 1u), 1.0 / 3.0);
    (*result).glossy += radiance * (solid_angle * lobe_weight(local.lobe, direction, spread));
#endif
}

fn to_local(object: u32, receiver: Receiver) -> Local {
    var local: Local;
    local.object = object;
    local.position = to_object(object, receiver.position);
    local.normal = turn_to_object(object, receiver.normal);
#ifdef SEVERAL
    let center = to_world(object, bakes.objects[object].csm_center);
    let radius = scale_of(object) * bakes.objects[object].csm_radius;
    local.between = between_candidates(receiver.position, center, radius, object, receiver.object);
#endif
#ifdef GLOSSY
    let view = turn_to_object(object, receiver.view);
    local.lobe = make_lobe(local.normal, view, receiver.roughness, receiver.f_zero);
#endif
    return local;
}

// A number from 0 to 1 for a node's light, another one for each receiver.
fn random(seed: u32, place: u32, turn: u32) -> f32 {
    return unit_float(hash(seed ^ hash(place)) + turn * GOLDEN_RATIO);
}

// Adds a power of that brightness, in the colour of the texel that sends it: the one at `place` of the light below a node, from 0 to the
// node's brightness.
fn add_sender(
    result: ptr<function, Gathered>,
    start: Sender,
    texels: u32,
    place: f32,
    bright: f32,
    local: Local,
    receiver: Receiver,
    seed: u32,
    turn: u32,
) {
    let first_power = 2u * bakes.objects[local.object].first_light;
    let sender = choose_sender(first_power, start.node, start.rank, texels, place);
    let sent = powers[first_power + sender.node];
    // Rounding may lead to one that sends nothing.
    let color = sent.rgb / max(brightness(sent), 1e-30);
    add_transfer(result, leaf_texel(local.object, sender.rank), color * bright, local, receiver, seed, turn);
    (*result).cut += 1u;
}

// Light that one of an object's texels sends in the name of several objects, in areas of its own space: all of it, where that is not
// negative, and the place that chooses the texel.
struct Errand {
    bright: f32,
    place: f32,
}

const NO_ERRAND: Errand = Errand(-1.0, 0.0);

// Adds an object's own light by a cut through its nodes, or what it sends on an errand from a texel below the first of them.
fn gather_from(result: ptr<function, Gathered>, object: u32, errand: Errand, receiver: Receiver, seed: u32, turn: u32) {
    let local = to_local(object, receiver);
    let first_node = bakes.objects[object].first_node;
    let first_power = 2u * bakes.objects[object].first_light;
    let is_errand = errand.bright >= 0.0;
    let end = node_count(object);
    var index = 0u;
    var rank = 0u;
    while index < end {
        let node = unpack_node(object, tree[first_node + index]);
        let count = (node.skip - index + 1u) / 2u;
        let power = powers[first_power + index];
        let most = max(power.r, max(power.g, power.b));
        if most > 0.0 {
            let bound = largest_transfer(node, local);
            if count > 1u && bound * most > settings.threshold && !is_errand {
                index += 1u;
                continue;
            }
            if bound > 0.0 {
                var bright = brightness(power);
                var place = random(seed, first_power + index, turn) * bright;
                if is_errand {
                    bright = errand.bright;
                    place = errand.place;
                }
                add_sender(result, Sender(index, rank), count, place, bright, local, receiver, seed, turn);
            }
        }
        rank += count;
        index = node.skip;
    }
}

#ifdef SEVERAL
fn in_world(receiver: Receiver) -> Local {
    var local: Local;
    local.position = receiver.position;
    local.normal = receiver.normal;
#ifdef GLOSSY
    local.lobe = make_lobe(receiver.normal, receiver.view, receiver.roughness, receiver.f_zero);
#endif
    return local;
}

// A node over the objects, which face all ways.
fn top_node(index: u32) -> Node {
    var node: Node;
    node.center = bakes.top[index].center;
    node.radius = bakes.top[index].radius;
    node.cosine = -1.0;
    node.skip = bakes.top[index].skip;
    return node;
}

// An object below a node over the objects, chosen in proportion to what it sends, and what it sends in the name of all of them.
struct Messenger {
    object: u32,
    errand: Errand,
}

fn choose_messenger(node: u32, seed: u32, turn: u32) -> Messenger {
    let bright = brightness(powers[top_place(node)]);
    var place = random(seed, top_place(node), turn) * bright;
    var at = node;
    while bakes.top[at].object == NONE {
        let first = brightness(powers[top_place(at + 1u)]);
        if place < first {
            at += 1u;
        } else {
            place -= first;
            at = bakes.top[at + 1u].skip;
        }
    }
    let object = bakes.top[at].object;
    let scale = scale_of(object);
    return Messenger(object, Errand(bright / (scale * scale), place / (scale * scale)));
}

/// Light from all objects; `seed` is another one for each receiver. From turn to turn other texels send in the name of a node, evenly
/// spread over what all of them send.
fn gather(receiver: Receiver, seed: u32, turn: u32) -> Gathered {
    let local = in_world(receiver);
    let end = top_node_count();
    var result = Gathered();
    var index = 0u;
    while index < end {
        let node = top_node(index);
        let power = powers[top_place(index)];
        let most = max(power.r, max(power.g, power.b));
        if most > 0.0 {
            let bound = largest_transfer(node, local);
            let object = bakes.top[index].object;
            if object == NONE && bound * most > settings.threshold {
                index += 1u;
                continue;
            }
            if bound > 0.0 {
                var sent = Messenger(object, NO_ERRAND);
                if object == NONE {
                    sent = choose_messenger(index, seed, turn);
                }
                gather_from(&result, sent.object, sent.errand, receiver, seed, turn);
            }
        }
        index = node.skip;
    }
    return result;
}
#else
/// Light from the object; see the one for several.
fn gather(receiver: Receiver, seed: u32, turn: u32) -> Gathered {
    var result = Gathered();
    if bakes.count > 0u {
        gather_from(&result, 0u, NO_ERRAND, receiver, seed, turn);
    }
    return result;
}
#endif
