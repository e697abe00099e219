// Leaves its depth at pixels that nothing behind can change any more.
uniform sampler2D image;
uniform float least_transmittance;

void main() {
    if (1.0 - texelFetch(image, ivec2(gl_FragCoord.xy), 0).a >= least_transmittance) discard;
}
