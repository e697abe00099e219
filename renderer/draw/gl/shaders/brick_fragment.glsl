// Integrate emission and absorption along a ray inside a brick's visible bounds, front to back, as
// renderer/bricks/sampling.py says.

uniform float stride_px;
uniform vec2 center_px;          // of the image
uniform mat3 origins;            // columns: at the image's centre, per pixel to the right, per pixel down
uniform mat3 directions;
uniform float slope_per_px;
uniform float start;             // of the rays, at the near plane
uniform vec3 atlas_scale;        // 1 / texels of the atlas
uniform float termination_alpha; // rays end behind it
uniform uvec2 jitter_per_px;     // in 2^-32

flat in vec3 brick_low;
flat in vec3 brick_high;
flat in vec3 brick_corner;
flat in vec3 brick_texel;
flat in vec2 brick_steps;
out vec4 color;

// Added to a position in a brick, it leaves multiples of 2^-12, which float32 holds wherever the brick is in the atlas.
const float COARSE = float(MAX_ATLAS_SIDE);

vec4 composite_under(vec4 before, vec4 extinction, float segment_length) {
    float alpha = opacity_of_depth(extinction.a * segment_length);
    vec3 emitted = extinction.a > 0.0 ? extinction.rgb * (alpha / extinction.a) : vec3(0.0);
    return before + (1.0 - before.a) * vec4(emitted, alpha);
}

void main() {
    vec2 at_px = (gl_FragCoord.xy - 0.5) * stride_px + 0.5 - center_px;
    vec3 origin = origins * vec3(1.0, at_px), direction = directions * vec3(1.0, at_px);
    // A ray parallel to the faces across an axis is outside the box or inside; in a face it belongs to the box above.
    bvec3 is_across = equal(direction, vec3(0.0));
    vec3 is_outside = max(vec3(lessThan(origin, brick_low)), vec3(greaterThanEqual(origin, brick_high)));
    if (dot(vec3(is_across), is_outside) > 0.0) discard;
    vec3 speed = direction + vec3(is_across);
    vec3 one = (brick_low - origin) / speed, other = (brick_high - origin) / speed;
    vec3 near = mix(min(one, other), vec3(-LARGE_FLOAT32), is_across), far = mix(max(one, other), vec3(LARGE_FLOAT32), is_across);
    float enter = max(max(near.x, near.y), max(near.z, start)), leave = min(far.x, min(far.y, far.z));
    if (!(leave > enter)) discard;

    uvec2 pixel = uvec2((gl_FragCoord.xy - 0.5) * stride_px + 0.5);
    float jitter = float((pixel.x * jitter_per_px.x + pixel.y * jitter_per_px.y) >> 8) / 16777216.0;
    float num_steps = (leave - enter) * length(direction) * brick_steps.x / brick_steps.y;
    float num = clamp(floor(num_steps * (1.0 + DITHER * (jitter - 0.5)) + 0.5 + jitter), 1.0, float(MAX_SAMPLES));
    num += mod(num, 4.0) == 0.0 ? 1.0 : 0.0;
    float segment = (leave - enter) / num;
    float segment_length = segment * sqrt(1.0 + slope_per_px * slope_per_px * dot(at_px, at_px));
    vec3 cell = (origin + (enter + 0.5 * segment) * direction - brick_corner) * brick_steps.x;
    vec3 step_cells = segment * brick_steps.x * direction, first_texel = brick_texel - COARSE;
    int number = 0, num_samples = int(num);
    vec4 result = vec4(0.0);
    // Not `for`: software renderers run its body once more when the condition fails.
    do {
        vec3 texel = (clamp(cell, MIN_SAMPLE_CELL, MAX_SAMPLE_CELL) + COARSE) + first_texel;
        result = composite_under(result, look_up(texel * atlas_scale), segment_length);
        cell += step_cells;
    } while (++number < num_samples && result.a <= termination_alpha);
    if (result.a == 0.0) discard;
    color = result;
}
