"use strict";
// Plays a trajectory. Particles are interpolated linearly between stored frames and drawn as water or colored by speed.
// Water is a screen-space fluid (after van der Laan, Green and Sainz, 2009): a smooth depth of soft spheres, shaded per pixel.

const header = JSON.parse(document.getElementById("header").textContent);
const canvas = document.getElementById("view");
const showMessage = (text) => { document.getElementById("message").textContent = text; };

// ---- vectors and column-major 4x4 matrices
const sub = (a, b) => a.map((x, i) => x - b[i]);
const dot = (a, b) => a.reduce((s, x, i) => s + x * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const l = Math.hypot(...a); return a.map((x) => x / l); };
function lookAt(eye, target, up) {
  const f = unit(sub(target, eye)), r = unit(cross(f, up)), u = cross(r, f);
  return [r[0], u[0], -f[0], 0, r[1], u[1], -f[1], 0, r[2], u[2], -f[2], 0, -dot(r, eye), -dot(u, eye), dot(f, eye), 1];
}
function multiply(a, b) {
  const o = new Array(16).fill(0);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) o[c * 4 + r] += a[k * 4 + r] * b[c * 4 + k];
  return o;
}
function perspective(fov, aspect, near, far) {
  const f = 1 / Math.tan(fov / 2);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0];
}
// The matrix from a solid's frame to the world between two poses: x, y, z, then a quaternion w, x, y, z.
function placement(a, b, blend) {
  const sign = a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6] < 0 ? -1 : 1;
  const mixed = Array.from(a, (value, k) => (1 - blend) * value + blend * (k > 2 ? sign : 1) * b[k]), q = mixed.slice(3), l = Math.hypot(...q);
  const [w, x, y, z] = q.map((value) => value / l);
  return [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0, 2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
    2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0, mixed[0], mixed[1], mixed[2], 1];
}
const STILL = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
function orthographic(half, near, far) {
  return [1 / half, 0, 0, 0, 0, 1 / half, 0, 0, 0, 0, 2 / (near - far), 0, 0, 0, (far + near) / (near - far), 1];
}

// ---- shaders
const COMMON = `#version 300 es
precision highp float; precision highp int; precision highp sampler2DShadow;
const vec3 SUN = normalize(vec3(-0.45, -0.42, 0.79));
vec3 toneMap(vec3 c) { c = mix(c, 0.8 + 0.2 * (1.0 - exp(-(c - 0.8) / 0.2)), step(0.8, c)); return pow(clamp(c, 0.0, 1.0), vec3(1.0 / 2.2)); }
vec3 linear(vec3 c) { return pow(c, vec3(2.2)); }
vec3 environmentRadiance(vec3 d) {
  vec3 c = mix(vec3(0.93, 0.95, 0.97), vec3(0.56, 0.68, 0.86), pow(clamp(d.z, 0.0, 1.0), 0.6));
  c = mix(c, vec3(0.69), clamp(-d.z * 5.0, 0.0, 1.0));
  return c + smoothstep(0.86, 0.92, dot(d, SUN)) * 1.6;
}
`;
const SHADOW = `
uniform sampler2DShadow shadowMap; uniform mat4 sunMatrix;
float sunlit(vec3 p) {
  vec3 q = (sunMatrix * vec4(p, 1.0)).xyz * 0.5 + 0.5;
  if (any(lessThan(q.xy, vec2(0.0))) || any(greaterThan(q.xy, vec2(1.0)))) return 1.0;
  float s = 0.0;
  for (int y = -2; y <= 2; y++) for (int x = -2; x <= 2; x++) s += texture(shadowMap, vec3(q.xy + vec2(x, y) * 0.0022, q.z - 0.004));
  return s / 25.0;
}
`;
const LIQUIDS = header.liquids.length;
const PARTICLE = `
layout(location = 0) in vec2 corner; layout(location = 1) in vec3 previous; layout(location = 2) in vec3 next; layout(location = 3) in uint liquid;
uniform float blend, radius, frameTime; uniform vec3 low, extent; uniform mat4 view, projection;
out vec2 disc; out vec3 center; out float speed; flat out uint kind;
void main() {
  kind = liquid;
  vec3 a = low + previous * extent, b = low + next * extent;
  center = (view * vec4(mix(a, b, blend), 1.0)).xyz;
  speed = length(b - a) / frameTime;
  disc = corner;
  gl_Position = projection * vec4(center + vec3(corner * radius, 0.0), 1.0);
  if (min(min(previous.x, previous.y), previous.z) == 1.0 || min(min(next.x, next.y), next.z) == 1.0) gl_Position = vec4(0.0, 0.0, 2.0, 1.0);  // not in the scene
}`;
const SPHERE = `
in vec2 disc; in vec3 center; in float speed; uniform float radius; uniform mat4 projection;
vec3 sphere() {
  float r2 = dot(disc, disc); if (r2 > 1.0) discard;
  vec3 n = vec3(disc, sqrt(1.0 - r2));
  vec4 clip = projection * vec4(center + n * radius, 1.0);
  gl_FragDepth = clip.z / clip.w * 0.5 + 0.5;
  return n;
}
`;
const SOFT_SPHERE = `
in vec2 disc; in vec3 center; in float speed; uniform float radius; uniform mat4 projection;
float softDepth() { float r2 = dot(disc, disc); if (r2 > 1.0) discard; return -center.z - 0.6 * radius * (1.0 - r2); }
`;
const SCREEN = `layout(location = 0) in vec2 corner; out vec2 uv; void main() { uv = corner * 0.5 + 0.5; gl_Position = vec4(corner, 0.0, 1.0); }`;

const SOURCES = {
  depthOnly: [`layout(location = 0) in vec3 position; uniform mat4 sunMatrix, model; void main() { gl_Position = sunMatrix * model * vec4(position, 1.0); }`, `void main() {}`],
  particleShadow: [PARTICLE, SPHERE + `void main() { sphere(); }`],
  floor: [`layout(location = 0) in vec2 corner; uniform mat4 view, projection; out vec3 p;
    void main() { p = vec3(corner * 12.0, 0.0); gl_Position = projection * view * vec4(p, 1.0); }`,
  SHADOW + `in vec3 p; uniform vec2 viewport; uniform float contact; out vec4 color;
    void main() {
      float far = smoothstep(0.75, 2.6, length(p.xy));
      vec3 c = vec3(0.93, 0.94, 0.95) * mix(vec3(0.56, 0.60, 0.66), vec3(1.0), sunlit(p));
      float up = gl_FragCoord.y / viewport.y;
      color = vec4(mix(c, mix(vec3(0.93, 0.95, 0.97), vec3(0.70, 0.79, 0.88), up * 0.9), far), 1.0); color.rgb = toneMap(color.rgb);
    }`],
  backdrop: [SCREEN, `in vec2 uv; out vec4 color; void main() { color = vec4(toneMap(mix(vec3(0.93, 0.95, 0.97), vec3(0.70, 0.79, 0.88), uv.y * 0.9)), 1.0); }`],
  solid: [`layout(location = 0) in vec3 position; layout(location = 1) in vec3 normal; uniform mat4 view, projection, model; out vec3 p, n;
    void main() { p = (model * vec4(position, 1.0)).xyz; n = mat3(model) * normal; gl_Position = projection * view * vec4(p, 1.0); }`,
  SHADOW + `in vec3 p, n; uniform vec3 eye; out vec4 color;
    void main() {
      vec3 m = normalize(n), v = normalize(eye - p); if (dot(m, v) < 0.0) m = -m;
      float sun = max(dot(m, SUN), 0.0) * sunlit(p + m * 0.01);
      float sky = 0.5 + 0.5 * m.z, low = clamp(p.z / 0.35, 0.0, 1.0);
      vec3 light = sun * vec3(1.0, 0.94, 0.84) * 0.80 + sky * vec3(0.66, 0.76, 0.90) * 0.46 * (0.6 + 0.4 * low)
                 + (1.0 - sky) * vec3(0.8, 0.78, 0.74) * 0.26 * (0.35 + 0.65 * low);
      float rim = pow(1.0 - max(dot(m, v), 0.0), 4.0) * 0.10;
      color = vec4(toneMap(vec3(0.74, 0.38, 0.21) * light + rim), 1.0);
    }`],
  lines: [`layout(location = 0) in vec3 position; uniform mat4 view, projection, model; uniform float height; out float fade;
    void main() { fade = mix(0.55, 0.12, position.z / height); gl_Position = projection * view * model * vec4(position, 1.0); gl_Position.z -= 2e-4 * gl_Position.w; }`,
  `in float fade; out vec4 color; void main() { color = vec4(0.42, 0.49, 0.55, fade); }`],
  speed: [PARTICLE, SPHERE + `uniform mat4 view; out vec4 color;
    void main() {
      vec3 n = transpose(mat3(view)) * sphere();
      float s = clamp(speed / 4.5, 0.0, 1.0);
      vec3 slow = vec3(0.03, 0.14, 0.42), mid = vec3(0.03, 0.50, 0.72), fast = vec3(0.86, 0.93, 0.90);
      vec3 c = s < 0.5 ? mix(slow, mid, s * 2.0) : mix(mid, fast, s * 2.0 - 1.0);
      color = vec4(toneMap(c * (0.45 + 0.65 * max(dot(n, SUN), 0.0) + 0.2 * n.z)), 1.0);
    }`],
  // The water's depth is the mean of wide soft spheres, weighted by how near they are to the front. Single particles stay
  // round, neighbors merge, and there are no artifacts of a blur.
  front: [PARTICLE, SOFT_SPHERE + `out float depth;
    // Only the core of a sphere counts as front: its soft rim alone would cut a hole into the water behind it.
    void main() { depth = softDepth(); if (dot(disc, disc) > 0.31) discard; vec4 clip = projection * vec4(0.0, 0.0, -depth, 1.0); gl_FragDepth = clip.z / clip.w * 0.5 + 0.5; }`],
  gather: [PARTICLE, SOFT_SPHERE + `uniform sampler2D front; out vec4 sums;
    void main() {
      float back = softDepth() - texelFetch(front, ivec2(gl_FragCoord.xy), 0).r, t = back / (1.6 * radius), q = 1.0 - dot(disc, disc);
      float w = q * q * q * exp(-t * t); sums = vec4(w * back / radius, w, 0.0, 1.0);
    }`],
  surface: [SCREEN, `in vec2 uv; uniform sampler2D front, sums; uniform float radius; out float depth;
    void main() {
      vec2 s = texelFetch(sums, ivec2(gl_FragCoord.xy), 0).rg;
      depth = s.g < 0.1 ? 1e4 : texelFetch(front, ivec2(gl_FragCoord.xy), 0).r + s.r / s.g * radius;
    }`],
  thickness: [PARTICLE, `in vec2 disc; flat in uint kind; uniform float radius; uniform vec3 absorptions[${LIQUIDS}], scatterings[${LIQUIDS}];
    layout(location = 0) out vec4 absorption; layout(location = 1) out vec4 scattering;
    // A disc of radius 1.9 r and this height has the particle's volume, (2 r)^3. Both are sums over the liquids along a ray.
    void main() {
      float r2 = dot(disc, disc); if (r2 > 1.0) discard;
      float thickness = 0.74 * radius * (1.0 - r2);
      absorption = vec4(thickness * absorptions[kind], thickness); scattering = vec4(thickness * scatterings[kind], 1.0);
    }`],
  compose: [SCREEN, `in vec2 uv; uniform sampler2D scene, sceneDepth, waterDepth, absorbed, scattered; uniform mat4 view; uniform vec2 lens, range; uniform float lift; out vec4 color;
    float meters(float z) { return range.x * range.y / (range.y - z * (range.y - range.x)); }
    vec3 position(vec2 q, float d) { return vec3((q * 2.0 - 1.0 - vec2(0.0, lift)) * lens * d, -d); }
    float depthAt(vec2 q) { return texture(waterDepth, q).r; }
    void main() {
      vec3 background = texture(scene, uv).rgb; float d = depthAt(uv), solid = meters(texture(sceneDepth, uv).r);
      if (d > 1e3 || d > solid) { color = vec4(background, 1.0); return; }
      vec2 px = 1.0 / vec2(textureSize(waterDepth, 0)); vec3 p = position(uv, d);
      // The flatter of the two neighbors on each axis, so that normals do not bend around an outline.
      vec3 r = position(uv + vec2(px.x, 0), depthAt(uv + vec2(px.x, 0))) - p, l = p - position(uv - vec2(px.x, 0), depthAt(uv - vec2(px.x, 0)));
      vec3 u = position(uv + vec2(0, px.y), depthAt(uv + vec2(0, px.y))) - p, b = p - position(uv - vec2(0, px.y), depthAt(uv - vec2(0, px.y)));
      vec3 n = normalize(cross(abs(r.z) < abs(l.z) ? r : l, abs(u.z) < abs(b.z) ? u : b));
      vec3 v = normalize(-p); float cosine = clamp(dot(n, v), 0.02, 1.0);
      vec4 sums = texture(absorbed, uv); float all = max(sums.a, 1e-6);
      vec3 absorption = sums.rgb / all, scattering = texture(scattered, uv).rgb / all;  // as in mixed_look of the video
      float thickness = min(sums.a, max(solid - d, 0.0) + 0.02);
      vec2 shifted = uv - n.xy * clamp(thickness, 0.01, 0.12) * 0.25 / (lens * 2.0 * d);
      if (meters(texture(sceneDepth, shifted).r) < d) shifted = uv;
      vec3 refracted = linear(texture(scene, shifted).rgb);
      mat3 toWorld = transpose(mat3(view)); vec3 m = toWorld * n, w = toWorld * v;
      vec3 transmittance = exp(-absorption * thickness);  // as in the video, see water.py
      vec3 body = refracted * transmittance + scattering * (0.62 + 0.38 * dot(m, SUN)) * (1.0 - exp(-12.0 * thickness));
      float fresnel = 0.02 + 0.98 * pow(1.0 - cosine, 5.0);
      vec3 reflected = 2.0 * cosine * m - w;
      vec3 c = mix(body, environmentRadiance(reflected), fresnel * 0.85) + 0.55 * pow(clamp(dot(reflected, SUN), 0.0, 1.0), 160.0);
      color = vec4(toneMap(c), 1.0);
    }`],
  // Antialiasing of the finished picture: blur along edges of brightness (T. Lottes, "FXAA", NVIDIA 2009).
  smooth: [SCREEN, `in vec2 uv; uniform sampler2D scene; out vec4 color;
    float luma(vec3 c) { return dot(c, vec3(0.299, 0.587, 0.114)); }
    void main() {
      vec2 px = 1.0 / vec2(textureSize(scene, 0)); vec3 middle = texture(scene, uv).rgb;
      float nw = luma(texture(scene, uv + vec2(-px.x, px.y)).rgb), ne = luma(texture(scene, uv + px).rgb);
      float sw = luma(texture(scene, uv - px).rgb), se = luma(texture(scene, uv + vec2(px.x, -px.y)).rgb), m = luma(middle);
      float low = min(m, min(min(nw, ne), min(sw, se))), high = max(m, max(max(nw, ne), max(sw, se)));
      if (high - low < max(0.03, high * 0.08)) { color = vec4(middle, 1.0); return; }
      vec2 along = vec2((sw + se) - (nw + ne), (nw + sw) - (ne + se));
      along = clamp(along / (min(abs(along.x), abs(along.y)) + max((nw + ne + sw + se) * 0.03125, 0.0078)), -8.0, 8.0) * px;
      vec3 near = 0.5 * (texture(scene, uv - along / 6.0).rgb + texture(scene, uv + along / 6.0).rgb);
      vec3 wide = 0.5 * near + 0.25 * (texture(scene, uv - along * 0.5).rgb + texture(scene, uv + along * 0.5).rgb);
      float w = luma(wide); color = vec4(w < low || w > high ? near : wide, 1.0);
    }`],
};

function build(gl) {
  const programs = {};
  for (const [name, parts] of Object.entries(SOURCES)) {
    const program = gl.createProgram();
    parts.forEach((text, i) => {
      const shader = gl.createShader(i ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
      gl.shaderSource(shader, COMMON + text); gl.compileShader(shader); gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(name + ": " + gl.getShaderInfoLog(shader));
    });
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(name + ": " + gl.getProgramInfoLog(program));
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const info = gl.getActiveUniform(program, i);
      uniforms[info.name] = [gl.getUniformLocation(program, info.name), info.type];
    }
    programs[name] = { program, uniforms };
  }
  return programs;
}

async function unpack() {
  const text = document.getElementById("data").textContent.trim(), bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  let offset = 0;
  const take = (ArrayType, count) => { const a = new ArrayType(buffer, offset, count); offset += a.byteLength; return a; };
  const solids = [header, ...header.moving].map((s) => ({ faces: take(Uint32Array, s.faces * 3), vertices: take(Float32Array, s.vertices * 3), normals: take(Float32Array, s.vertices * 3) }));
  const poses = Array.from({ length: header.moving.length + header.containerMoves }, () => take(Float32Array, header.frames * 7));
  const liquids = take(Uint16Array, header.particles);
  const positions = take(Uint16Array, header.frames * header.particles * 3);
  const step = header.particles * 3;  // stored as differences from the previous frame, modulo 2^16
  for (let i = step; i < positions.length; i++) positions[i] = positions[i] + positions[i - step];
  return { solids, poses, liquids, positions };
}

function main(data) {
  const gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
  if (!gl) { showMessage("This page needs WebGL 2."); return; }
  const hasWater = !!gl.getExtension("EXT_color_buffer_float");
  const style = document.getElementById("style");
  if (!hasWater) { style.value = "speed"; style.disabled = true; }
  const programs = build(gl);

  // ---- buffers
  const upload = (target, array) => { const b = gl.createBuffer(); gl.bindBuffer(target, b); gl.bufferData(target, array, gl.STATIC_DRAW); return b; };
  const corners = upload(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]));
  const screen = gl.createVertexArray(); gl.bindVertexArray(screen);
  gl.enableVertexAttribArray(0); gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
  const solids = data.solids.map((mesh) => {
    const array = gl.createVertexArray(); gl.bindVertexArray(array);
    upload(gl.ARRAY_BUFFER, mesh.vertices); gl.enableVertexAttribArray(0); gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    upload(gl.ARRAY_BUFFER, mesh.normals); gl.enableVertexAttribArray(1); gl.vertexAttribPointer(1, 3, gl.FLOAT, false, 0, 0);
    upload(gl.ELEMENT_ARRAY_BUFFER, mesh.faces);
    return { array, count: mesh.faces.length };
  });
  const [cx, cy, cz] = header.container, box = [];
  const corner = (i, z) => [[-cx, -cy], [cx, -cy], [cx, cy], [-cx, cy]][i % 4].map((x) => x / 2).concat([z]);
  for (let i = 0; i < 4; i++) box.push(corner(i, 0), corner(i + 1, 0), corner(i, cz), corner(i + 1, cz), corner(i, 0), corner(i, cz));
  const lines = gl.createVertexArray(); gl.bindVertexArray(lines);
  upload(gl.ARRAY_BUFFER, new Float32Array(box.flat())); gl.enableVertexAttribArray(0); gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
  const particles = gl.createVertexArray(); gl.bindVertexArray(particles);
  gl.bindBuffer(gl.ARRAY_BUFFER, corners); gl.enableVertexAttribArray(0); gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
  const previous = gl.createBuffer(), next = gl.createBuffer(), size = header.particles * 3;
  [previous, next].forEach((b, i) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, b); gl.bufferData(gl.ARRAY_BUFFER, size * 2, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(i + 1); gl.vertexAttribPointer(i + 1, 3, gl.UNSIGNED_SHORT, true, 0, 0); gl.vertexAttribDivisor(i + 1, 1);
  });

  upload(gl.ARRAY_BUFFER, data.liquids); gl.enableVertexAttribArray(3); gl.vertexAttribIPointer(3, 1, gl.UNSIGNED_SHORT, 0, 0); gl.vertexAttribDivisor(3, 1);

  // ---- framebuffers
  const target = (w, h, inner, format, type, filter, depthTexture, second) => {
    const texture = (i, f, t, flt) => {
      const x = gl.createTexture(); gl.bindTexture(gl.TEXTURE_2D, x); gl.texImage2D(gl.TEXTURE_2D, 0, i, w, h, 0, f, t, null);
      for (const p of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, p, flt);
      for (const p of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, p, gl.CLAMP_TO_EDGE);
      return x;
    };
    const frame = gl.createFramebuffer(); gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    const out = { frame, w, h };
    if (inner) { out.color = texture(inner, format, type, filter); gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, out.color, 0); }
    if (second) { out.second = texture(inner, format, type, filter); gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT1, gl.TEXTURE_2D, out.second, 0); gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]); }
    if (depthTexture) { out.depth = texture(gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT, gl.NEAREST); gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, out.depth, 0); }
    return out;
  };
  const shadow = target(1024, 1024, 0, 0, 0, 0, true);
  gl.bindTexture(gl.TEXTURE_2D, shadow.depth);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
  for (const p of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, p, gl.LINEAR);
  let targets = null;
  function resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2), w = Math.max(2, Math.round(canvas.clientWidth * ratio)), h = Math.max(2, Math.round(canvas.clientHeight * ratio));
    if (targets && canvas.width === w && canvas.height === h) return;
    if (targets) for (const t of Object.values(targets)) { gl.deleteFramebuffer(t.frame); gl.deleteTexture(t.color); if (t.second) gl.deleteTexture(t.second); if (t.depth) gl.deleteTexture(t.depth); }
    canvas.width = w; canvas.height = h;
    targets = { scene: target(w, h, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, gl.LINEAR, true), picture: target(w, h, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, gl.LINEAR, false) };
    if (hasWater) {
      targets.front = target(w, h, gl.R32F, gl.RED, gl.FLOAT, gl.NEAREST, true);
      targets.sums = target(w, h, gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT, gl.NEAREST, false);
      targets.waterDepth = target(w, h, gl.R32F, gl.RED, gl.FLOAT, gl.NEAREST, false);
      targets.thickness = target(w >> 1, h >> 1, gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT, gl.LINEAR, false, true);
    }
  }

  // ---- drawing
  let active = null;
  const setters = {
    [gl.FLOAT]: (l, v) => gl.uniform1f(l, v), [gl.FLOAT_VEC2]: (l, v) => gl.uniform2fv(l, v), [gl.FLOAT_VEC3]: (l, v) => gl.uniform3fv(l, v),
    [gl.FLOAT_MAT4]: (l, v) => gl.uniformMatrix4fv(l, false, v), [gl.SAMPLER_2D]: (l, v) => gl.uniform1i(l, v), [gl.SAMPLER_2D_SHADOW]: (l, v) => gl.uniform1i(l, v),
  };
  const use = (name, values, textures = {}) => {
    active = programs[name]; gl.useProgram(active.program); let unit_ = 0;
    for (const [key, texture] of Object.entries(textures)) {
      gl.activeTexture(gl.TEXTURE0 + unit_); gl.bindTexture(gl.TEXTURE_2D, texture);
      if (active.uniforms[key]) setters[active.uniforms[key][1]](active.uniforms[key][0], unit_);
      unit_++;
    }
    for (const [key, value] of Object.entries(values)) if (active.uniforms[key]) setters[active.uniforms[key][1]](active.uniforms[key][0], value);
  };
  const bindTarget = (t, w, h) => { gl.bindFramebuffer(gl.FRAMEBUFFER, t ? t.frame : null); gl.viewport(0, 0, t ? t.w : w, t ? t.h : h); };
  const drawScreen = () => { gl.bindVertexArray(screen); gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4); };
  // The first solid stands still; the others and a moving container have poses.
  const poseAt = (number, frame, blend) => {
    const at = (f) => data.poses[number].subarray(7 * f, 7 * f + 7);
    return placement(at(frame), at(Math.min(frame + 1, header.frames - 1)), blend);
  };
  const drawSolids = (models) => solids.forEach((solid, k) => {
    if (!solid.count) return;
    setters[gl.FLOAT_MAT4](active.uniforms.model[0], models[k]);
    gl.bindVertexArray(solid.array); gl.drawElements(gl.TRIANGLES, solid.count, gl.UNSIGNED_INT, 0);
  });
  const drawParticles = () => { gl.bindVertexArray(particles); gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, header.particles); };

  const start = sub(header.eye, header.target), far0 = Math.hypot(...start);
  const orbit = { azimuth: Math.atan2(start[1], start[0]), elevation: Math.asin(start[2] / far0), distance: far0, target: header.target.slice() };
  const fov = header.fov * Math.PI / 180;
  const LIFT = 0.09;  // upward shift of the picture, in half heights, to clear the play bar
  const sun = unit([-0.45, -0.42, 0.79]), reach = 0.75 * Math.hypot(cx, cy) + 0.35, mid = [0, 0, 0.45];
  const sunView = lookAt(mid.map((m, i) => m + sun[i] * 6), mid, [0, 0, 1]), sunProjection = orthographic(reach, 1, 12), sunMatrix = multiply(sunProjection, sunView);
  const [absorptions, scatterings] = ["absorption", "scattering"].map((key) => header.liquids.flatMap((liquid) => liquid[key]));
  let shown = -1;

  function draw(time) {
    resize();
    const exact = Math.min(time / header.frameTime, header.frames - 1), frame = Math.min(Math.floor(exact), Math.max(header.frames - 2, 0)), blend = exact - frame;
    if (frame !== shown) {
      const pick = (f) => data.positions.subarray(f * size, (f + 1) * size);
      gl.bindBuffer(gl.ARRAY_BUFFER, previous); gl.bufferSubData(gl.ARRAY_BUFFER, 0, pick(frame));
      gl.bindBuffer(gl.ARRAY_BUFFER, next); gl.bufferSubData(gl.ARRAY_BUFFER, 0, pick(Math.min(frame + 1, header.frames - 1)));
      shown = frame;
    }
    const w = canvas.width, h = canvas.height, aspect = w / h, wide = Math.max(1, header.aspect / aspect);
    const distance = orbit.distance * wide * (1 + LIFT), c = Math.cos(orbit.elevation);
    const eye = orbit.target.map((t, i) => t + distance * [c * Math.cos(orbit.azimuth), c * Math.sin(orbit.azimuth), Math.sin(orbit.elevation)][i]);
    const near = 0.05 * distance, far = 3 * distance + 10;
    const view = lookAt(eye, orbit.target, [0, 0, 1]), projection = perspective(fov, aspect, near, far);
    projection[9] = -LIFT;
    const values = { view, projection, eye, sunMatrix, blend, low: header.low, extent: header.extent, frameTime: header.frameTime * Math.sqrt(header.scale), viewport: [w, h], height: cz, radius: header.radius };

    const models = solids.map((_, k) => (k ? poseAt(k - 1, frame, blend) : STILL));
    gl.enable(gl.DEPTH_TEST); gl.disable(gl.BLEND); gl.depthMask(true);
    bindTarget(shadow); gl.clear(gl.DEPTH_BUFFER_BIT);
    use("depthOnly", values); drawSolids(models);
    use("particleShadow", { ...values, view: sunView, projection: sunProjection, radius: header.radius }); drawParticles();

    const asWater = style.value === "water";
    bindTarget(targets.scene); gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.DEPTH_TEST); use("backdrop", values); drawScreen(); gl.enable(gl.DEPTH_TEST);
    if (eye[2] > 0) { use("floor", values, { shadowMap: shadow.depth }); drawScreen(); }
    use("solid", values, { shadowMap: shadow.depth }); drawSolids(models);
    if (!asWater) { use("speed", { ...values, radius: header.radius * 1.05 }); drawParticles(); }
    gl.enable(gl.BLEND); gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA); gl.depthMask(false);
    if (!header.open) { use("lines", { ...values, model: header.containerMoves ? poseAt(header.moving.length, frame, blend) : STILL }); gl.bindVertexArray(lines); gl.drawArrays(gl.LINES, 0, 24); }
    gl.disable(gl.BLEND); gl.depthMask(true);

    const finish = (picture) => { gl.disable(gl.DEPTH_TEST); bindTarget(null, w, h); use("smooth", {}, { scene: picture.color }); drawScreen(); };
    if (!asWater) { finish(targets.scene); return; }
    const softSphere = { ...values, radius: header.radius * 2.6 };
    bindTarget(targets.front); gl.clearBufferfv(gl.COLOR, 0, [1e4, 0, 0, 0]); gl.clear(gl.DEPTH_BUFFER_BIT);
    use("front", softSphere); drawParticles();
    gl.disable(gl.DEPTH_TEST); gl.enable(gl.BLEND); gl.blendFunc(gl.ONE, gl.ONE);
    bindTarget(targets.sums); gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
    use("gather", softSphere, { front: targets.front.color }); drawParticles();
    gl.disable(gl.BLEND); bindTarget(targets.waterDepth);
    use("surface", softSphere, { front: targets.front.color, sums: targets.sums.color }); drawScreen();
    bindTarget(targets.thickness); for (const k of [0, 1]) gl.clearBufferfv(gl.COLOR, k, [0, 0, 0, 0]);
    gl.enable(gl.BLEND); gl.blendFunc(gl.ONE, gl.ONE);
    use("thickness", { ...values, radius: header.radius * 1.9, "absorptions[0]": absorptions, "scatterings[0]": scatterings }); drawParticles();
    gl.disable(gl.BLEND);
    const lensY = Math.tan(fov / 2);
    bindTarget(targets.picture);
    use("compose", { view, lift: LIFT, lens: [lensY * aspect, lensY], range: [near, far] },
      { scene: targets.scene.color, sceneDepth: targets.scene.depth, waterDepth: targets.waterDepth.color, absorbed: targets.thickness.color, scattered: targets.thickness.second });
    drawScreen();
    finish(targets.picture);
  }

  // ---- time, keys and pointers
  const bar = document.getElementById("time"), clock = document.getElementById("clock"), button = document.getElementById("play"), speed = document.getElementById("speed");
  const last = header.frameTime * (header.frames - 1), options = new URLSearchParams(location.hash.slice(1));
  let time = Math.min(parseFloat(options.get("t")) || 0, last), playing = !options.has("t"), lastTick = null, dirty = true;
  if (options.has("style") && hasWater) style.value = options.get("style") === "speed" ? "speed" : "water";
  bar.max = last || 1;
  const setPlaying = (on) => { if (on && time >= last) time = 0; playing = on; button.innerHTML = on ? "&#10074;&#10074;" : "&#9654;"; dirty = true; };
  button.onclick = () => setPlaying(!playing);
  bar.oninput = () => { time = parseFloat(bar.value); setPlaying(false); };
  style.onchange = () => { dirty = true; };
  window.addEventListener("resize", () => { dirty = true; });
  window.addEventListener("keydown", (e) => {
    if (e.target === bar || e.target.tagName === "SELECT") return;
    if (e.code === "Space") { e.preventDefault(); button.blur(); setPlaying(!playing); }
    if (e.code === "ArrowRight" || e.code === "ArrowLeft") { setPlaying(false); time = Math.min(Math.max(time + (e.code === "ArrowRight" ? 1 : -1) * header.frameTime, 0), last); }
  });
  const pointers = new Map(); let pinch = 0;
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); pointers.set(e.pointerId, [e.clientX, e.clientY, e.button]); pinch = 0; });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (e) => { pointers.delete(e.pointerId); pinch = 0; });
  canvas.addEventListener("pointermove", (e) => {
    const old = pointers.get(e.pointerId); if (!old) return;
    const dx = e.clientX - old[0], dy = e.clientY - old[1]; pointers.set(e.pointerId, [e.clientX, e.clientY, old[2]]); dirty = true;
    if (pointers.size === 2) {
      const [a, b] = [...pointers.values()], span = Math.hypot(a[0] - b[0], a[1] - b[1]);
      if (pinch) orbit.distance = Math.min(Math.max(orbit.distance * pinch / span, 0.3), 20);
      pinch = span; return;
    }
    if (old[2] === 2 || e.shiftKey) {
      const a = orbit.azimuth, scale = orbit.distance * 2 * Math.tan(fov / 2) / canvas.clientHeight;
      orbit.target[0] += Math.sin(a) * dx * scale; orbit.target[1] -= Math.cos(a) * dx * scale; orbit.target[2] += dy * scale;
    } else {
      orbit.azimuth -= dx * 0.006; orbit.elevation = Math.min(Math.max(orbit.elevation + dy * 0.006, 0.03), 1.55);
    }
  });
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); orbit.distance = Math.min(Math.max(orbit.distance * Math.exp(e.deltaY * 0.001), 0.3), 20); dirty = true; }, { passive: false });
  setPlaying(playing);
  function tick(now) {
    if (playing && lastTick !== null) { time += Math.min((now - lastTick) / 1000, 0.1) * parseFloat(speed.value); if (time >= last) { time = last; setPlaying(false); } }
    lastTick = now;
    bar.value = time; clock.textContent = time.toFixed(2) + " / " + last.toFixed(2) + " s";
    if (playing || dirty || Math.abs(time - tick.drawn) > 1e-9) { dirty = false; tick.drawn = time; draw(time); }
    requestAnimationFrame(tick);
  }
  requestAnimationFrame(tick);
}

unpack().then(main).catch((error) => { showMessage("This page could not be shown: " + error.message); console.error(error); });
