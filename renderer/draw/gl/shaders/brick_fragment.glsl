// The integral of emission and absorption along a ray inside a brick's box, front to back (brick_batch.py says which).

uniform float stride_px;
uniform vec2 center_px;          // of the image
uniform mat3 origins;            // columns: at the image's centre, per pixel to the right, per pixel down
uniform mat3 directions;
uniform float slope_per_px;
uniform float start;             // of the rays, beyond which nothing is before the near plane
uniform vec3 atlas_scale;        // 1 / texels of the atlas
uniform float opaque;            // alpha behind which nothing counts
uniform uvec2 jitter_per_px;      // in 2^-32
uniform float dither;            // of the number of parts

flat in vec3 brick_low;
flat in vec3 brick_high;
flat in vec3 brick_corner;
flat in vec3 brick_texel;
flat in vec2 brick_steps;
out vec4 color;

// Added to a place in a brick, it leaves multiples of 2^-12, which float32 holds wherever the brick is in the atlas.
const float COARSE = 2048.0;
// No ray is as long.
const float FAR = 1e30;
// Where samples are, in cells of the brick: between the centres of its first and last texel, for what else lies in the
// atlas is another brick's, or nobody's. Rays of extremely wide views are rounded to more than that.
const float FIRST = -0.25, LAST = 16.25;
// Parts of a way, as on the processor; no ray that is not rounded beyond its brick has more.
const float MAX_SAMPLES = 4095.0;

vec4 behind(vec4 before, vec4 extinction, float way) {
    float alpha = opacity_of_depth(extinction.a * way);
    vec3 emitted = extinction.a > 0.0 ? extinction.rgb * (alpha / extinction.a) : vec3(0.0);
    return before + (1.0 - before.a) * vec4(emitted, alpha);
}

void main() {
    vec2 at_px = (gl_FragCoord.xy - 0.5) * stride_px + 0.5 - center_px;
    vec3 origin = origins * vec3(1.0, at_px), direction = directions * vec3(1.0, at_px);
    // A ray that lies in a plane across an axis is beside the box or inside; within a face it belongs to the box above.
    bvec3 is_across = equal(direction, vec3(0.0));
    vec3 is_outside = max(vec3(lessThan(origin, brick_low)), vec3(greaterThanEqual(origin, brick_high)));
    if (dot(vec3(is_across), is_outside) > 0.0) discard;
    vec3 speed = direction + vec3(is_across);
    vec3 one = (brick_low - origin) / speed, other = (brick_high - origin) / speed;
    vec3 near = mix(min(one, other), vec3(-FAR), is_across), far = mix(max(one, other), vec3(FAR), is_across);
    float enter = max(max(near.x, near.y), max(near.z, start)), leave = min(far.x, min(far.y, far.z));
    if (!(leave > enter)) discard;

    uvec2 pixel = uvec2((gl_FragCoord.xy - 0.5) * stride_px + 0.5);
    float phase = float((pixel.x * jitter_per_px.x + pixel.y * jitter_per_px.y) >> 8) / 16777216.0;
    float num_steps = (leave - enter) * length(direction) * brick_steps.x / brick_steps.y;
    float num = clamp(floor(num_steps * (1.0 + dither * (phase - 0.5)) + 0.5 + phase), 1.0, MAX_SAMPLES);
    num += mod(num, 4.0) == 0.0 ? 1.0 : 0.0;
    float part = (leave - enter) / num;
    float way = part * sqrt(1.0 + slope_per_px * slope_per_px * dot(at_px, at_px));
    vec3 place = (origin + (enter + 0.5 * part) * direction - brick_corner) * brick_steps.x;
    vec3 step_place = part * brick_steps.x * direction, first_texel = brick_texel - COARSE;
    int number = 0, num_parts = int(num);
    vec4 result = vec4(0.0);
    // Not `for`: software renderers go through the body of one once more when its condition fails.
    do {
        vec3 texel = (clamp(place, FIRST, LAST) + COARSE) + first_texel;
        result = behind(result, look_up(texel * atlas_scale), way);
        place += step_place;
    } while (++number < num_parts && result.a <= opaque);
    if (result.a == 0.0) discard;
    color = result;
}
