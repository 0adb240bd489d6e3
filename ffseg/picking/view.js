// The image under the hand: where a pixel stands on the screen, and what is drawn over it.
const $ = (id) => document.getElementById(id);
const NS = "http://www.w3.org/2000/svg";
const SHARP = 3; // screen pixels an image pixel may have before its edges are shown

export class View {
  scale = 1;
  x = 0;
  y = 0;
  size = [1, 1];

  constructor(stage) {
    this.stage = stage;
    new ResizeObserver(() => this.fitted && this.fit()).observe(stage);
  }

  show(source, width, height) {
    this.size = [width, height];
    const picture = $("picture");
    picture.style.visibility = "hidden"; // until it is there: the one before would be taken for it
    picture.onload = () => { picture.style.visibility = ""; };
    if (source) picture.src = source;
    else picture.removeAttribute("src");
    $("layers").style.width = `${width}px`;
    $("layers").style.height = `${height}px`;
    $("drawing").setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.fit();
  }

  get whole() { // the scale at which all of the image is seen
    const box = this.stage.getBoundingClientRect(), [width, height] = this.size;
    return Math.min(box.width / width, box.height / height) || 1;
  }

  fit() {
    const box = this.stage.getBoundingClientRect(), [width, height] = this.size;
    this.scale = this.whole;
    this.x = (box.width - width * this.scale) / 2;
    this.y = (box.height - height * this.scale) / 2;
    this.place();
    this.fitted = true;
  }

  zoom(by, x = this.stage.clientWidth / 2, y = this.stage.clientHeight / 2) {
    const scale = Math.min(64, Math.max(0.02, this.scale * by)), ratio = scale / this.scale;
    this.x = x - (x - this.x) * ratio;
    this.y = y - (y - this.y) * ratio;
    this.scale = scale;
    this.place();
  }

  move(dx, dy) {
    this.x += dx;
    this.y += dy;
    this.place();
  }

  place() {
    this.fitted = false;
    $("layers").style.transform = `translate(${this.x}px, ${this.y}px) scale(${this.scale})`;
    $("layers").style.setProperty("--pen", `${1 / this.scale}px`); // of the screen, whatever the image's are
    $("layers").classList.toggle("pixels", this.scale >= SHARP);
    for (const mark of $("marks").querySelectorAll("circle")) mark.setAttribute("r", 6 / this.scale);
  }

  // Pixel coordinates as everywhere in ffseg: integers at pixel centres.
  at(event) {
    const box = this.stage.getBoundingClientRect();
    return [event.clientX - box.left - this.x, event.clientY - box.top - this.y].map((on) => Math.round((on / this.scale - 0.5) * 10) / 10);
  }

  holds([x, y]) {
    return x >= -0.5 && y >= -0.5 && x <= this.size[0] - 0.5 && y <= this.size[1] - 0.5;
  }

  region(found, id = "region") {
    const path = $(id);
    path.setAttribute("d", found?.path ?? "");
    path.setAttribute("transform", `scale(${found?.factor ?? 1})`);
  }

  marks(picked) {
    const draw = (tag, attributes) => {
      const element = document.createElementNS(NS, tag);
      for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
      return element;
    };
    const dots = (rows, kind) => rows.map(([x, y]) => draw("circle", { cx: x + 0.5, cy: y + 0.5, r: 6 / this.scale, class: kind }));
    const boxes = picked.boxes.map(([left, top, right, bottom]) => draw("rect", { x: left + 0.5, y: top + 0.5, width: right - left, height: bottom - top, class: "round" }));
    $("marks").replaceChildren(...boxes, ...dots(picked.starts, "start"), ...dots(picked.nots, "not"));
  }

  box(corners) {
    $("box").toggleAttribute("hidden", !corners);
    if (!corners) return;
    const [left, top, right, bottom] = corners;
    for (const [name, value] of Object.entries({ x: left + 0.5, y: top + 0.5, width: right - left, height: bottom - top })) $("box").setAttribute(name, value);
  }

  stroke(stroke) {
    $("stroke").toggleAttribute("hidden", !stroke);
    if (!stroke) return;
    const points = stroke.points.length > 1 ? stroke.points : [stroke.points[0], stroke.points[0]];
    $("stroke").setAttribute("points", points.map(([x, y]) => `${x + 0.5},${y + 0.5}`).join(" "));
    $("stroke").setAttribute("stroke-width", 2 * stroke.radius);
    $("stroke").setAttribute("stroke", stroke.inside ? "#3ddc84" : "#ff5f57");
  }
}
