// SPDX-License-Identifier: GPL-3.0-or-later
// The 3D view: people as skinned meshes on a ground grid, in the world frame of the motion file (metres, z up).
// Without a library: what is drawn is one kind of mesh, a grid and a few lines, and a library of 0.7 MB or more would have
// to be fetched at set-up, shipped in the extension, and inlined into every page.
"use strict";

/** Decode base64 of little-endian values into a typed array of the given kind. */
function decodeArray(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  if (new Uint8Array(new Uint16Array([1]).buffer)[0] !== 1) {
    const size = Kind.BYTES_PER_ELEMENT;
    for (let i = 0; i < bytes.length; i += size) bytes.subarray(i, i + size).reverse();
  }
  return new Kind(bytes.buffer);
}

/** The motion as the page holds it: poses the skeleton and skins vertices by the equations of the body model. */
class CapturedMotion {
  constructor(data) {
    this.parents = data.parents;
    this.count = data.parents.length;
    this.times = decodeArray(data.times, Float32Array);
    this.frames = decodeArray(data.frames, Int32Array);
    this.camera = decodeArray(data.camera, Float32Array); // rows of 3 × 4, world from camera
    this.intrinsics = data.intrinsics;
    this.imageSize = data.imageSize;
    this.triangles = decodeArray(data.triangles, data.wide ? Uint32Array : Uint16Array);
    this.skinJoints = decodeArray(data.skinJoints, Uint8Array);
    this.skinWeights = decodeArray(data.skinWeights, Uint8Array);
    this.people = data.people.map((person) => ({
      color: person.color,
      low: person.low,
      step: person.step,
      rest: person.rest,
      positions: decodeArray(person.positions, Uint16Array),
      rotations: decodeArray(person.rotations, Int16Array),
      trans: decodeArray(person.trans, Float32Array),
      valid: decodeArray(person.valid, Uint8Array),
    }));
  }

  /** 3 × 4 world from camera at a row; a static camera has one for all. */
  cameraAt(row) {
    const at = this.camera.length === 12 ? 0 : 12 * row;
    return this.camera.subarray(at, at + 12);
  }

  /** Pose of every part at a row: 3 × 4 each, part to world; its last column is the joint. */
  pose(person, row) {
    const { rotations, trans, rest } = this.people[person];
    const out = new Float32Array(12 * this.count);
    for (let k = 0; k < this.count; k++) {
      const R = rotationOf(rotations, 4 * (row * this.count + k));
      const p = this.parents[k], at = 12 * k;
      for (let i = 0; i < 3; i++) {
        if (p < 0) {
          for (let j = 0; j < 3; j++) out[at + 4 * i + j] = R[3 * i + j];
          out[at + 4 * i + 3] = rest[k][i] + trans[3 * row + i];
          continue;
        }
        const q = 12 * p + 4 * i;
        let moved = out[q + 3];
        for (let j = 0; j < 3; j++) {
          out[at + 4 * i + j] = out[q] * R[j] + out[q + 1] * R[3 + j] + out[q + 2] * R[6 + j];
          moved += out[q + j] * (rest[k][j] - rest[p][j]);
        }
        out[at + 4 * i + 3] = moved;
      }
    }
    return out;
  }

  /** Rest-pose points of the model to the world, 3 × 4 for every part: x = A v, blended by the skinning weights. */
  skinning(person, row) {
    const out = this.pose(person, row), { rest } = this.people[person];
    for (let at = 0, k = 0; k < this.count; k++, at += 12) {
      for (let i = at; i < at + 12; i += 4) {
        for (let j = 0; j < 3; j++) out[i + 3] -= out[i + j] * rest[k][j];
      }
    }
    return out;
  }

  /** Joints at a row, metres. */
  joints(person, row) {
    const pose = this.pose(person, row);
    return Array.from({ length: this.count }, (_, k) => [3, 7, 11].map((i) => pose[12 * k + i]));
  }

  /** A vertex in the rest pose, metres. */
  restVertex(person, n) {
    const { positions, low, step } = this.people[person];
    return [0, 1, 2].map((i) => low[i] + step[i] * positions[3 * n + i]);
  }

  /** Some vertices at a row, metres, skinned as on the GPU. */
  vertices(person, row, numbers) {
    const A = this.skinning(person, row);
    return numbers.map((n) => {
      const v = [...this.restVertex(person, n), 1], out = [0, 0, 0];
      for (let s = 4 * n; s < 4 * n + 4; s++) {
        const at = 12 * this.skinJoints[s], w = this.skinWeights[s] / 255;
        for (let i = 0; i < 3; i++) for (let j = 0; j < 4; j++) out[i] += w * A[at + 4 * i + j] * v[j];
      }
      return out;
    });
  }

  /** Where a person's pelvis is at a row. */
  pelvis(person, row) {
    const { trans, rest } = this.people[person];
    return [0, 1, 2].map((i) => rest[0][i] + trans[3 * row + i]);
  }

  /** Normals of the rest pose, one per vertex. */
  normals(person) {
    const T = this.triangles, out = new Float32Array(this.people[person].positions.length);
    const v = Array.from({ length: out.length / 3 }, (_, n) => this.restVertex(person, n));
    for (let f = 0; f < T.length; f += 3) {
      const n = cross(minus(v[T[f + 1]], v[T[f]]), minus(v[T[f + 2]], v[T[f]]));
      for (let c = f; c < f + 3; c++) for (let i = 0; i < 3; i++) out[3 * T[c] + i] += n[i];
    }
    return out;
  }
}

function rotationOf(q, at) {
  let w = q[at], x = q[at + 1], y = q[at + 2], z = q[at + 3];
  const n = Math.hypot(w, x, y, z);
  (w /= n), (x /= n), (y /= n), (z /= n);
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
  ];
}

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / Math.hypot(...a));

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

/** Draws a motion into a canvas. The constructor throws if the browser has no WebGL 2. */
class MotionView {
  constructor(canvas, motion) {
    this.canvas = canvas;
    this.motion = motion;
    this.row = 0;
    this.follow = false;
    this.through = false; // through the capture's camera
    this.light = unit([-0.35, -0.5, 1]);
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, stencil: true });
    if (!gl) throw new Error("no WebGL 2");
    this.gl = gl;
    this.build();
    this.frameMotion();
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => (this.build(), this.draw()));
    this.listen();
    new ResizeObserver(() => this.draw()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => (this.readColors(), this.draw()));
  }

  build() {
    const { gl, motion } = this;
    this.programs = { mesh: program(gl, MESH), ground: program(gl, GROUND), lines: program(gl, LINES) };
    this.people = motion.people.map((person, n) => {
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      attribute(gl, 0, person.positions, 3, gl.UNSIGNED_SHORT, true);
      attribute(gl, 1, motion.normals(n), 3, gl.FLOAT, false);
      buffer(gl, gl.ARRAY_BUFFER, motion.skinJoints);
      gl.enableVertexAttribArray(2);
      gl.vertexAttribIPointer(2, 4, gl.UNSIGNED_BYTE, 0, 0);
      attribute(gl, 3, motion.skinWeights, 4, gl.UNSIGNED_BYTE, true);
      buffer(gl, gl.ELEMENT_ARRAY_BUFFER, motion.triangles);
      const parts = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, parts);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, 3, motion.count);
      const points = Array.from(motion.times, (_, row) => [...motion.pelvis(n, row).slice(0, 2), 0.006]).flat();
      return { array, parts, path: this.lines(points) };
    });
    this.frustum = this.lines(new Array(48).fill(0));
    this.readColors();
  }

  lines(points) {
    const { gl } = this, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const data = attribute(gl, 0, new Float32Array(points), 3, gl.FLOAT, false);
    return { array, data, count: points.length / 3 };
  }

  readColors() {
    const style = getComputedStyle(document.documentElement);
    const rgb = (name) => {
      const hex = style.getPropertyValue(name.replace(/^var\(|\)$/g, "")).trim();
      return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255); // "#rrggbb"
    };
    this.colors = { line: rgb("--grid"), ground: rgb("--ground"), ink: rgb("--faint") };
    this.colors.people = this.motion.people.map((person) => rgb(`--body${person.color.match(/\d+/)[0]}`));
  }

  /** Look at the whole motion, a little beside the capture's camera. */
  frameMotion() {
    const { motion } = this, low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
    motion.people.forEach((_, n) => motion.times.forEach((_t, row) => motion.pelvis(n, row).forEach((x, i) => {
      low[i] = Math.min(low[i], x);
      high[i] = Math.max(high[i], x);
    })));
    const C = motion.cameraAt(0);
    this.middle = low.map((x, i) => (x + high[i]) / 2);
    this.target = [...this.middle];
    this.reach = Math.max(6, 1.2 * Math.hypot(high[0] - low[0], high[1] - low[1]) + 4);
    this.forward = Math.atan2(C[3] - this.middle[0], this.middle[1] - C[7]);
    this.distance = Math.min(14, Math.max(3.4, 2.2 + 1.0 * Math.hypot(...minus(high, low))));
    this.look("front");
  }

  /** Turn to one of the named views. */
  look(name) {
    this.through = name === "camera";
    this.elevation = name === "top" ? 1.5 : 0.22;
    this.azimuth = this.forward + { front: 0.35, side: Math.PI / 2, top: 0, camera: 0 }[name];
    if (!this.follow) this.target = [...this.middle];
    this.draw();
  }

  listen() {
    const { canvas } = this, held = new Map();
    const spread = () => {
      const [a, b] = [...held.values()];
      return b ? { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2, d: Math.hypot(a[0] - b[0], a[1] - b[1]) } : null;
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before) return;
      const earlier = spread();
      held.set(event.pointerId, [event.clientX, event.clientY]);
      const now = spread();
      if (now) {
        this.pan(now.x - earlier.x, now.y - earlier.y);
        this.zoom(earlier.d / Math.max(now.d, 1));
      } else if (event.shiftKey || event.buttons > 1) {
        this.pan(event.clientX - before[0], event.clientY - before[1]);
      } else {
        this.orbit(event.clientX - before[0], event.clientY - before[1]);
      }
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => held.delete(event.pointerId));
    }
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => this.frameMotion());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(0.0012 * event.deltaY));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[event.key];
      if (!step) return;
      event.preventDefault();
      this.orbit(...step);
    });
  }

  orbit(dx, dy) {
    this.through = false;
    this.azimuth -= 0.008 * dx;
    this.elevation = Math.min(1.55, Math.max(-0.3, this.elevation + 0.008 * dy));
    this.changed();
  }

  pan(dx, dy) {
    const { side, up } = this.axes(), scale = (0.9 * this.distance) / this.canvas.clientHeight;
    this.through = false;
    this.target = this.target.map((x, i) => x + scale * (dy * up[i] - dx * side[i]));
    this.changed();
  }

  zoom(factor) {
    this.through = false;
    this.distance = Math.min(60, Math.max(0.6, this.distance * factor));
    this.changed();
  }

  changed() {
    this.onchange?.();
    this.draw();
  }

  axes() {
    const ce = Math.cos(this.elevation), se = Math.sin(this.elevation);
    const back = [ce * Math.sin(this.azimuth), -ce * Math.cos(this.azimuth), se];
    const side = [Math.cos(this.azimuth), Math.sin(this.azimuth), 0];
    return { back, side, up: cross(back, side) };
  }

  /** Projection · view, in column order, and the direction to the eye. */
  matrices(width, height) {
    if (this.through) return this.throughCamera(width, height);
    if (this.follow) this.target = this.motion.pelvis(0, this.row);
    const { back, side, up } = this.axes();
    const eye = this.target.map((x, i) => x + this.distance * back[i]);
    const f = 2.1 * Math.min(1, (1.2 * width) / height);
    return { view: projected([[(f * height) / width, 0], [f, 0]], [side, up, back], eye), eye: back, at: eye };
  }

  throughCamera(width, height) {
    const C = this.motion.cameraAt(this.row), K = this.motion.intrinsics, [w, h] = this.motion.imageSize;
    const column = (j, sign) => [0, 4, 8].map((i) => sign * C[i + j]);
    const scale = 2 * Math.min(width / w, height / h);
    const x = [(scale * K[0][0]) / width, (-scale * (K[0][2] - (w - 1) / 2)) / width];
    const y = [(scale * K[1][1]) / height, (scale * (K[1][2] - (h - 1) / 2)) / height];
    const back = column(2, -1), eye = [C[3], C[7], C[11]];
    return { view: projected([x, y], [column(0, 1), column(1, -1), back], eye), eye: back, at: eye };
  }

  draw() {
    const { gl, canvas, motion, row, colors } = this;
    if (gl.isContextLost() || !canvas.clientWidth) return;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    const { view, eye, at } = this.matrices(width, height);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.drawGround(view);
    const use = this.use(this.programs.lines, view);
    motion.people.forEach((_, n) => {
      gl.uniform4f(use("color"), ...colors.people[n], 0.7);
      gl.bindVertexArray(this.people[n].path.array);
      gl.drawArrays(gl.LINE_STRIP, 0, this.people[n].path.count);
    });
    if (!this.through) this.drawFrustum(use);
    const mesh = this.use(this.programs.mesh, view);
    gl.uniform3f(mesh("light"), ...this.light);
    gl.uniform3f(mesh("eye"), ...eye);
    motion.people.forEach((_, n) => this.drawPerson(n, row, mesh, at[2] > 0));
    gl.bindVertexArray(null);
  }

  use({ handle, uniforms }, view) {
    this.gl.useProgram(handle);
    this.gl.uniformMatrix4fv(uniforms.view, false, view);
    return (name) => uniforms[name];
  }

  drawGround(view) {
    const { gl, colors } = this, use = this.use(this.programs.ground, view);
    gl.uniform3f(use("line"), ...colors.line);
    gl.uniform3f(use("ground"), ...colors.ground);
    gl.uniform3f(use("middle"), ...this.middle);
    gl.uniform1f(use("reach"), this.reach);
    gl.bindVertexArray(null);
    gl.depthMask(false);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.depthMask(true);
  }

  drawFrustum(use) {
    const { gl, motion } = this, C = motion.cameraAt(this.row), K = motion.intrinsics, [w, h] = motion.imageSize;
    const world = (p) => [0, 4, 8].map((i) => C[i] * p[0] + C[i + 1] * p[1] + C[i + 2] * p[2] + C[i + 3]);
    const corner = (u, v) => world([((u - K[0][2]) / K[0][0]) * 0.35, ((v - K[1][2]) / K[1][1]) * 0.35, 0.35]);
    const c = [corner(0, 0), corner(w, 0), corner(w, h), corner(0, h)], o = world([0, 0, 0]);
    const points = [0, 1, 2, 3].flatMap((i) => [o, c[i], c[i], c[(i + 1) % 4]]).flat();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.frustum.data);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, new Float32Array(points));
    gl.uniform4f(use("color"), ...this.colors.ink, 0.9);
    gl.bindVertexArray(this.frustum.array);
    gl.drawArrays(gl.LINES, 0, this.frustum.count);
  }

  drawPerson(n, row, use, withShadow) {
    const { gl, motion } = this, person = motion.people[n], [r, g, b] = this.colors.people[n];
    gl.bindTexture(gl.TEXTURE_2D, this.people[n].parts);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 3, motion.count, gl.RGBA, gl.FLOAT, motion.skinning(n, row));
    gl.uniform3f(use("low"), ...person.low);
    gl.uniform3f(use("size"), ...person.step.map((x) => 65535 * x));
    gl.bindVertexArray(this.people[n].array);
    const type = motion.triangles instanceof Uint32Array ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT;
    if (withShadow) { // each pixel darkened once
      gl.enable(gl.STENCIL_TEST);
      gl.stencilFunc(gl.EQUAL, 0, 255);
      gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
      gl.depthMask(false);
      gl.uniform1f(use("flat_"), 1);
      gl.uniform4f(use("color"), 0, 0, 0, 0.22);
      gl.drawElements(gl.TRIANGLES, motion.triangles.length, type, 0);
      gl.depthMask(true);
      gl.disable(gl.STENCIL_TEST);
    }
    gl.uniform1f(use("flat_"), 0);
    const grey = (r + g + b) / 3, seen = person.valid[row] ? 1 : 0.25; // a pose that was filled in is grey
    gl.uniform4f(use("color"), ...[r, g, b].map((x) => grey + seen * (x - grey)), 1);
    gl.drawElements(gl.TRIANGLES, motion.triangles.length, type, 0);
  }
}

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
