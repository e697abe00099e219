// Write a near depth at pixels that nothing behind can change any more.
uniform sampler2D image;
uniform float termination_transmittance;

void main() {
    if (1.0 - texelFetch(image, ivec2(gl_FragCoord.xy), 0).a >= termination_transmittance) discard;
}
