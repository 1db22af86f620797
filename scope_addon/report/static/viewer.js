// SPDX-License-Identifier: GPL-3.0-or-later
// The 3D view: people as skinned meshes on a ground grid, in the world frame of the motion file (metres, z up).
// Without a library: what is drawn is one kind of mesh, a grid and a few lines, and a library of 0.7 MB or more would
// have to be fetched at set-up, shipped in the extension, and inlined into every page.
"use strict";

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

  /** Between all people, so that none of several is followed out of the view. */
  middleAt(row) {
    const places = this.motion.people.map((_, n) => this.motion.pelvis(n, row));
    return [0, 1, 2].map((i) => places.reduce((sum, place) => sum + place[i], 0) / places.length);
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
    if (this.follow) this.target = this.middleAt(this.row);
    const { back, side, up } = this.axes();
    const eye = this.target.map((x, i) => x + this.distance * back[i]);
    const f = 2.1 * Math.min(1, (1.2 * width) / height);
    return { view: projected([[(f * height) / width, 0], [f, 0]], [side, up, back], eye), eye: back, at: eye };
  }

  throughCamera(width, height) {
    const C = this.motion.cameraAt(this.row), K = this.motion.intrinsicsAt(this.row), [w, h] = this.motion.imageSize;
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
    const { gl, motion } = this, C = motion.cameraAt(this.row), K = motion.intrinsicsAt(this.row), [w, h] = motion.imageSize;
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
