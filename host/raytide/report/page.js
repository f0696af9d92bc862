"use strict";
// Tables: a click on a heading sorts by full values, once more turns the order round.
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  const key = (row, column) => {
    const cell = row.cells[column];
    const value = cell.dataset.value;
    return value === undefined ? cell.textContent : (value === "inf" ? Infinity : value === "-inf" ? -Infinity : +value);
  };
  const compare = (a, b) => {
    if (typeof a === "number" && typeof b === "number") return isNaN(a) ? 1 : isNaN(b) ? -1 : a - b;
    return typeof a === typeof b ? a.localeCompare(b, "en", { numeric: true }) : typeof a === "number" ? -1 : 1;
  };
  heads.forEach((head, column) => {
    const sort = () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const body = table.tBodies[0];
      const rows = [...body.rows].sort((a, b) => compare(key(a, column), key(b, column)) * (down ? -1 : 1));
      body.append(...rows);
    };
    head.addEventListener("click", sort);
    head.addEventListener("keydown", (event) => { if (event.key === "Enter") sort(); });
  });
}
// Pictures: the slider moves the border, the wheel zooms about the pointer, dragging moves, a double click goes back.
for (const figure of document.querySelectorAll("figure.slider")) {
  const layers = figure.querySelector(".layers");
  const images = [...layers.querySelectorAll("img")];
  const over = layers.querySelector(".over");
  const border = figure.querySelector("input");
  let zoom = 1, x = 0, y = 0, held = null;
  const show = () => {
    const width = layers.clientWidth, height = layers.clientHeight;
    x = Math.min(0, Math.max(width * (1 - zoom), x));
    y = Math.min(0, Math.max(height * (1 - zoom), y));
    for (const image of images) image.style.transform = `translate(${x}px, ${y}px) scale(${zoom})`;
    if (over && border) over.style.clipPath = `inset(0 0 0 ${border.value}%)`;
  };
  if (border) border.addEventListener("input", show);
  layers.addEventListener("wheel", (event) => {
    event.preventDefault();
    const box = layers.getBoundingClientRect();
    const px = event.clientX - box.left, py = event.clientY - box.top;
    const next = Math.min(64, Math.max(1, zoom * Math.exp(-event.deltaY / 300)));
    x = px - (px - x) * next / zoom;
    y = py - (py - y) * next / zoom;
    zoom = next;
    show();
  }, { passive: false });
  layers.addEventListener("pointerdown", (event) => {
    held = { px: event.clientX - x, py: event.clientY - y };
    layers.setPointerCapture(event.pointerId);
  });
  layers.addEventListener("pointermove", (event) => {
    if (!held) return;
    x = event.clientX - held.px;
    y = event.clientY - held.py;
    show();
  });
  layers.addEventListener("pointerup", () => { held = null; });
  layers.addEventListener("pointercancel", () => { held = null; });
  layers.addEventListener("dragstart", (event) => event.preventDefault());
  layers.addEventListener("dblclick", () => { zoom = 1; x = y = 0; show(); });
}
document.getElementById("theme").addEventListener("click", () => {
  const root = document.documentElement;
  const dark = root.classList.contains("dark")
    || (!root.classList.contains("light") && matchMedia("(prefers-color-scheme: dark)").matches);
  root.classList.toggle("dark", !dark);
  root.classList.toggle("light", dark);
});
