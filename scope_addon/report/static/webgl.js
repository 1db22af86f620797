// SPDX-License-Identifier: GPL-3.0-or-later
// Shaders of the 3D view, and what it needs of WebGL 2.
"use strict";

const MESH = [`#version 300 es
uniform mat4 view; uniform vec3 low, size, light; uniform float flat_; uniform highp sampler2D parts;
layout(location=0) in vec3 position; layout(location=1) in vec3 normal;
layout(location=2) in uvec4 joints; layout(location=3) in vec4 weights;
out vec3 n;
void main() {
  vec4 r[3] = vec4[3](vec4(0), vec4(0), vec4(0));
  for (int s = 0; s < 4; s++) for (int i = 0; i < 3; i++)
    r[i] += weights[s] * texelFetch(parts, ivec2(i, int(joints[s])), 0);
  vec4 v = vec4(low + size * position, 1);
  vec3 p = vec3(dot(r[0], v), dot(r[1], v), dot(r[2], v));
  n = vec3(dot(r[0].xyz, normal), dot(r[1].xyz, normal), dot(r[2].xyz, normal));
  if (flat_ > 0.) p = vec3(p.xy - light.xy / light.z * max(p.z, 0.), .003);
  gl_Position = view * vec4(p, 1);
}`, `#version 300 es
precision highp float;
uniform vec4 color; uniform vec3 light, eye; uniform float flat_; in vec3 n; out vec4 result;
void main() {
  vec3 m = normalize(n);
  float sun = max(dot(m, light), 0.), sky = .5 + .5 * m.z, rim = pow(1. - abs(dot(m, eye)), 3.);
  vec3 lit = color.rgb * (.46 + .24 * sky + .42 * sun) + .08 * rim;
  result = flat_ > 0. ? color : vec4(lit, color.a);
}`];
const GROUND = [`#version 300 es
uniform mat4 view; uniform vec3 middle; uniform float reach; out vec2 at;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2. - 1.;
  at = middle.xy + reach * corner;
  gl_Position = view * vec4(at, 0, 1);
}`, `#version 300 es
precision highp float;
uniform vec3 line, ground, middle; uniform float reach; in vec2 at; out vec4 result;
float lines(float spacing) {
  vec2 d = abs(fract(at / spacing - .5) - .5) * spacing / fwidth(at);
  return 1. - min(min(d.x, d.y), 1.);
}
void main() {
  float fade = smoothstep(1., .35, length(at - middle.xy) / reach);
  float ink = max(lines(1.), .35 * lines(.25) * smoothstep(.25, .02, length(fwidth(at))));
  result = vec4(mix(ground, line, ink), fade * mix(.55, 1., ink));
}`];
const LINES = [`#version 300 es
uniform mat4 view; layout(location=0) in vec3 position; void main() { gl_Position = view * vec4(position, 1); }`,
`#version 300 es
precision highp float; uniform vec4 color; out vec4 result; void main() { result = color; }`];

/** Perspective projection, with [scale, shift] of x and y, of points seen from `eye` along −axes[2]; column order. */
function projected([[sx, tx], [sy, ty]], axes, eye) {
  const near = 0.05, far = 200, a = (near + far) / (near - far), b = (2 * near * far) / (near - far);
  const [X, Y, Z] = axes.map((axis) => [...axis, -dot(axis, eye)]);
  const rows = [0, 1, 2, 3].map((j) => [sx * X[j] + tx * Z[j], sy * Y[j] + ty * Z[j], a * Z[j], -Z[j]]);
  rows[3][2] += b;
  return rows.flat();
}

function program(gl, [vertex, fragment]) {
  const handle = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(handle, shader);
  }
  gl.linkProgram(handle);
  if (!gl.getProgramParameter(handle, gl.LINK_STATUS) && !gl.isContextLost()) {
    const logs = gl.getAttachedShaders(handle).map((shader) => gl.getShaderInfoLog(shader));
    throw new Error([gl.getProgramInfoLog(handle), ...logs].join("\n"));
  }
  const count = gl.getProgramParameter(handle, gl.ACTIVE_UNIFORMS) || 0;
  const names = Array.from({ length: count }, (_, i) => gl.getActiveUniform(handle, i).name);
  return { handle, uniforms: Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(handle, name)])) };
}

function buffer(gl, target, array) {
  const handle = gl.createBuffer();
  gl.bindBuffer(target, handle);
  gl.bufferData(target, array, gl.STATIC_DRAW);
  return handle;
}

function attribute(gl, place, array, size, type, normalized) {
  const handle = buffer(gl, gl.ARRAY_BUFFER, array);
  gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, size, type, normalized, 0, 0);
  return handle;
}
