// SPDX-License-Identifier: GPL-3.0-or-later
// The motion as the page holds it: decoding, and the forward kinematics and skinning of the body model. World frame of
// the motion file: metres, z up.
"use strict";

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / Math.hypot(...a));

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
    this.zoom = decodeArray(data.zoom, Float32Array);
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

  /** 3 × 3 intrinsics at a row. */
  intrinsicsAt(row) {
    const [[fx, s, cx], [, fy, cy]] = this.intrinsics, z = this.zoom[row];
    return [[fx * z, s * z, cx], [0, fy * z, cy], [0, 0, 1]];
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
