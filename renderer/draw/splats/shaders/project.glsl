// Project a splat's Gaussian to its footprint on the image, affinely about its centre (Zwicker et al. 2001, "EWA
// Splatting").
//
// Lengths are in model units, image coordinates in pixels with row 0 at the top. The depth axis points away from the eye.

layout(std140) uniform Shapes {
    // Three vectors for each shape: right, up and depth components of the standard deviations along the cell's three edges.
    vec4 shape_rows[3 * MAX_SHAPES];
};
uniform mat3 view_rotation;      // from model axes to right, up and depth axes
uniform vec3 view_translation;
uniform bool perspective;
uniform float scale_px;          // focal length in pixels, or pixels per model unit if the view is orthographic
uniform vec2 axis_px;            // position of the optical axis in the picture, in pixels
uniform vec2 tile_px;            // width and height of a tile, in pixels
uniform vec2 corner_px;          // first column and row of the tile
uniform float near_beyond_origin; // depth of the near plane minus that of the model's origin
uniform vec2 slope_limit;        // steepest x / depth and y / depth at which footprints are computed
uniform float min_sigma_px;      // smallest standard deviation of a footprint

// Stands for a length of 0: its square is still above 0.
const float MIN_LENGTH = 1e-18;
// Splats of a smaller area are invisible and are left out: below 1.2e-38, devices may round the area to 0 and divide by it.
const float MIN_AREA = 1e-37;

in vec3 center;
in vec4 areas;
in float shape;

struct Footprint {
    vec2 center_px;      // in the picture
    vec3 root;           // xx, yx, yy of the lower triangular (Cholesky) root of the widened covariance, in pixels
    float unit_depth;    // optical depth at the footprint's weight 1
    bool visible;
};

// Return exp(x^2) erfc(x) for x >= 0, with a relative error below 1.2e-7 (Press et al., "Numerical Recipes", 6.2, Chebyshev
// fit).
float scaled_erfc(float x) {
    float t = 1.0 / (1.0 + 0.5 * x);
    float p = -0.82215223 + t * 0.17087277;
    p = 1.48851587 + t * p;
    p = -1.13520398 + t * p;
    p = 0.27886807 + t * p;
    p = -0.18628806 + t * p;
    p = 0.09678418 + t * p;
    p = 0.37409196 + t * p;
    p = 1.00002368 + t * p;
    return t * exp(-1.26551223 + t * p);
}

Footprint project() {
    Footprint result;
    result.visible = false;
    if (areas.w < MIN_AREA) return result;
    int first = 3 * int(shape);
    vec3 right = shape_rows[first].xyz, up = shape_rows[first + 1].xyz, away = shape_rows[first + 2].xyz;
    vec3 from_origin = view_rotation * center;
    vec3 position = from_origin + view_translation;
    float mass = 1.0;

    // The near plane clips the Gaussian: the remainder has the moments of a truncated normal distribution. Depths are
    // measured from the model's origin, which keeps their digits if the eye is far away.
    float sigma = max(length(away), MIN_LENGTH);
    float a = (near_beyond_origin - from_origin.z) / sigma;
    if (a > CULLED_SIGMAS) return result;
    if (a > -CLIPPED_SIGMAS) {
        // mass = erfc(a / sqrt 2) / 2; hazard = pdf(a) / mass, without cancellation on either side.
        float scaled = scaled_erfc(abs(a) * 0.70710678);
        float bell = exp(-0.5 * a * a);
        mass = a > 0.0 ? 0.5 * bell * scaled : 1.0 - 0.5 * bell * scaled;
        float hazard = a > 0.0 ? 0.79788456 / scaled : 0.39894228 * bell / mass;
        float lost = clamp(hazard * (hazard - a), 0.0, 1.0);  // the share of the variance in depth that is cut off
        vec3 toward = away / sigma;
        position += vec3(dot(right, toward), dot(up, toward), sigma) * hazard;
        vec3 shrink = (1.0 - sqrt(1.0 - lost)) * toward;
        right -= dot(right, toward) * shrink;
        up -= dot(up, toward) * shrink;
        away -= sigma * shrink;
    }

    float magnification = perspective ? scale_px / position.z : scale_px;
    float stretch = 1.0;
    vec3 row_x = right, row_y = -up;
    if (perspective) {
        vec2 slope = clamp(position.xy / position.z, -slope_limit, slope_limit);
        row_x -= slope.x * away;
        row_y += slope.y * away;
        stretch = sqrt(1.0 + dot(slope, slope));
    }
    result.center_px = axis_px + magnification * vec2(position.x, -position.y);

    // Rows are in units of the longest component, so that no square and no product leaves the range of float32.
    vec3 longest = max(abs(row_x), abs(row_y));
    float unit = max(max(longest.x, max(longest.y, longest.z)), MIN_LENGTH);
    row_x /= unit;
    row_y /= unit;
    float unit_px = unit * magnification;

    // The ellipse is widened so that no standard deviation is under min_sigma_px. Its short side comes from a cross product,
    // not from a difference of products, in which digits would cancel.
    float xx = dot(row_x, row_x), xy = dot(row_x, row_y), yy = dot(row_y, row_y);
    float middle = 0.5 * (xx + yy);
    float large = middle + length(vec2(0.5 * (xx - yy), xy));
    float short_side = length(cross(row_x, row_y)) / sqrt(large);
    float narrowest = min_sigma_px / unit_px;
    if (sqrt(large) <= narrowest) {
        result.root = vec3(min_sigma_px, 0.0, min_sigma_px);
    } else {
        if (short_side < narrowest) {
            float small = short_side * short_side, least = narrowest * narrowest;
            float blend = (least - small) / (large - small);
            xx += blend * (large - xx);
            yy += blend * (large - yy);
            xy -= blend * xy;
            short_side = narrowest;
        }
        // The root and not the covariance is passed on, because a long thin footprint then keeps the digits of its short
        // side.
        float side = sqrt(xx);
        result.root = unit_px * vec3(side, xy / side, sqrt(large) * short_side / side);
    }
    float by_area = mass * stretch * (magnification / result.root.x) * (magnification / result.root.z);
    // The depth is finite, so that its product with a weight of 0 is 0.
    result.unit_depth = min(areas.w * by_area, LARGE_FLOAT32);
    result.visible = true;
    return result;
}
