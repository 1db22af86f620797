// SPDX-License-Identifier: GPL-3.0-or-later
// Keeps the 3D view, the overlay's picture, the player and the cursors of the plots at the same frame.
"use strict";

(() => {
  const byId = (id) => document.getElementById(id);
  const motion = new CapturedMotion(JSON.parse(byId("data").textContent));
  const { times, frames } = motion, last = times.length - 1;
  const pictures = [...document.querySelectorAll("#strip button")];
  const cursors = [...document.querySelectorAll(".plot .cursor")];
  const picture = byId("picture"), slider = byId("row"), play = byId("play");
  let row = 0, shown = null, playing = null;

  let view = null;
  try {
    view = new MotionView(byId("view"), motion);
  } catch (error) {
    byId("view").hidden = true;
    byId("no-view").hidden = false;
    document.querySelector(".views").hidden = true;
    if (error.message !== "no WebGL 2") console.error(error);
  }

  /** The row at a time: the last one that has begun. */
  function rowAt(time) {
    let low = 0, high = last;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= time + 1e-4) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** Share of the plots' width at a row. */
  const share = (at) => (last ? (times[at] - times[0]) / (times[last] - times[0]) : 0);

  function nearestPicture(at) {
    const distance = (button) => Math.abs(Number(button.dataset.row) - at);
    return pictures.reduce((best, button) => (!best || distance(button) < distance(best) ? button : best), null);
  }

  function seek(to) {
    row = Math.min(last, Math.max(0, Math.round(to)));
    slider.value = row;
    byId("time").textContent = `frame ${frames[row]}, ${times[row].toFixed(2)} s`;
    for (const cursor of cursors) {
      const at = `${(100 * share(row)).toFixed(3)}%`;
      cursor.setAttribute("x1", at);
      cursor.setAttribute("x2", at);
    }
    const button = nearestPicture(row);
    if (button && button !== shown && picture) {
      shown?.removeAttribute("aria-current");
      shown = button;
      button.setAttribute("aria-current", "true");
      picture.src = button.firstElementChild.src;
      byId("picture-frame").textContent = button.lastElementChild.textContent;
      const strip = byId("strip");
      strip.scrollLeft = button.offsetLeft - strip.offsetLeft - (strip.clientWidth - button.offsetWidth) / 2;
    }
    const unseen = motion.people.some((person) => !person.valid[row]);
    byId("pose-state").textContent = unseen ? "not seen, filled in" : "";
    if (view) {
      view.row = row;
      view.draw();
    }
  }

  function stop() {
    cancelAnimationFrame(playing);
    playing = null;
    play.textContent = "▶";
    play.setAttribute("aria-label", "Play");
  }

  function start() {
    let time = row >= last ? times[0] : times[row], before = performance.now();
    play.textContent = "❚❚";
    play.setAttribute("aria-label", "Pause");
    const step = (now) => {
      time += ((now - before) / 1000) * Number(byId("speed").value);
      before = now;
      const length = last ? times[last] - times[0] + (times[last] - times[0]) / last : 0;
      if (time > times[0] + length) time = times[0];
      const at = rowAt(time);
      if (at !== row) seek(at);
      playing = requestAnimationFrame(step);
    };
    playing = requestAnimationFrame(step);
  }

  const toggle = () => (playing === null ? start() : stop());
  const halt = (to) => (stop(), seek(to));

  play.addEventListener("click", toggle);
  slider.addEventListener("input", () => halt(Number(slider.value)));
  for (const button of pictures) button.addEventListener("click", () => halt(Number(button.dataset.row)));
  for (const button of document.querySelectorAll(".seek")) {
    button.addEventListener("click", () => halt(rowAt(Number(button.dataset.time))));
  }
  for (const plot of document.querySelectorAll(".plot.timed")) {
    const to = (event) => {
      const box = plot.getBoundingClientRect();
      halt(rowAt(times[0] + ((event.clientX - box.left) / box.width) * (times[last] - times[0])));
    };
    plot.addEventListener("pointerdown", to);
    plot.addEventListener("pointermove", (event) => event.buttons && to(event));
  }
  document.addEventListener("keydown", (event) => {
    if (event.target.closest("button, input, select, canvas")) return;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step) halt(row + step);
    else if (event.key === " ") toggle();
    else return;
    event.preventDefault();
  });
  if (view) {
    const buttons = [...document.querySelectorAll("[data-view]")];
    const press = (name) => buttons.forEach((b) => b.setAttribute("aria-pressed", String(b.dataset.view === name)));
    for (const button of buttons) {
      button.addEventListener("click", () => (view.look(button.dataset.view), press(button.dataset.view)));
    }
    view.onchange = () => press(null);
    byId("follow").addEventListener("change", (event) => {
      view.follow = event.target.checked;
      if (!view.follow) view.target = [...view.middle];
      view.draw();
    });
  }
  seek(0);
  // For tests and scripts in the browser's console.
  window.capturedMotion = { motion, view, seek, row: () => row };
})();
