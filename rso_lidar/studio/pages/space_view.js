// A view in space of a scene that Python packs: header as JSON, then positions and colours (see model/space_scene.py).
import { CSS2DObject, CSS2DRenderer, OrbitControls, THREE } from "nicegui-scene";

const models = new Map(); // geometries of targets by address, kept while the page lives
const FAR_AWAY = 9e9; // radius of the sky, which goes along with the camera
const CLICK_PX = 10; // a click chooses the nearest point within this distance
const NUDGES_PX = [0, -13, 13, -26, 26, -39, 39];

// Red, green and blue as bytes, each triple `repeat` times, as the linear values that three.js shades with.
function make_colours(rgb, repeat = 1) {
  const colour = new THREE.Color();
  const linear = new Float32Array(rgb.length * repeat);
  for (let k = 0; k < rgb.length; k += 3) {
    colour.setRGB(rgb[k] / 255, rgb[k + 1] / 255, rgb[k + 2] / 255, THREE.SRGBColorSpace);
    for (let n = 0; n < repeat; n++) colour.toArray(linear, repeat * k + 3 * n);
  }
  return new THREE.BufferAttribute(linear, 3);
}

async function load_model(address) {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error(`${address}: ${answer.status}`);
  const bytes = await answer.arrayBuffer();
  const count = bytes.byteLength / 39; // facets: three corners as float32, and a colour as bytes
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(bytes, 0, 9 * count), 3));
  geometry.setAttribute("color", make_colours(new Uint8Array(bytes, 36 * count, 3 * count), 3));
  geometry.computeVertexNormals();
  return geometry;
}

function make_disc() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 32;
  const context = canvas.getContext("2d");
  const fade = context.createRadialGradient(16, 16, 4, 16, 16, 16);
  fade.addColorStop(0, "#fff");
  fade.addColorStop(1, "#fff0");
  context.fillStyle = fade;
  context.fillRect(0, 0, 32, 32);
  return new THREE.CanvasTexture(canvas);
}

// The Earth as a sphere: day, a twilight of 18 degrees, night, and a brighter rim where the view grazes the air.
function make_earth({ radius, at, day, night }, sun) {
  const material = new THREE.ShaderMaterial({
    uniforms: {
      sun: { value: new THREE.Vector3(...(sun || [0, 0, 0])) },
      day: { value: new THREE.Color(day) },
      night: { value: new THREE.Color(night).multiplyScalar(0.12) },
    },
    vertexShader: `
      #include <common>
      #include <logdepthbuf_pars_vertex>
      varying vec3 up, toward;
      void main() {
        up = normal;
        vec4 place = modelMatrix * vec4(position, 1.0);
        toward = cameraPosition - place.xyz;
        gl_Position = projectionMatrix * viewMatrix * place;
        #include <logdepthbuf_vertex>
      }`,
    fragmentShader: `
      #include <common>
      #include <logdepthbuf_pars_fragment>
      uniform vec3 sun, day, night;
      varying vec3 up, toward;
      void main() {
        #include <logdepthbuf_fragment>
        float height = dot(normalize(up), sun);
        float light = smoothstep(-0.31, 0.12, height);
        float rim = pow(1.0 - max(dot(normalize(up), normalize(toward)), 0.0), 3.0);
        vec3 lit = day * (0.3 + 0.7 * max(height, 0.0)) + 0.8 * rim * day;
        gl_FragColor = vec4(mix(night, lit, light), 1.0);
        #include <colorspace_fragment>
      }`,
  });
  const earth = new THREE.Mesh(new THREE.SphereGeometry(radius, 180, 120), material);
  earth.position.set(...at);
  return earth;
}

export default {
  props: { url: String, models: String, label: String },
  emits: ["pick"],
  template: `
    <div style="position:relative;width:100%;height:100%;min-height:200px;overflow:hidden">
      <canvas ref="canvas" tabindex="0" role="img" :aria-label="label" style="display:block;position:absolute"
        @pointerdown="pressed = [$event.clientX, $event.clientY]" @pointerup="pick"></canvas>
      <div ref="words" style="position:absolute;inset:0;pointer-events:none;overflow:hidden;font-size:11px"></div>
      <div ref="legend" style="position:absolute;left:8px;bottom:8px;pointer-events:none;font-size:12px"></div>
      <button type="button" @click="reset" style="position:absolute;right:8px;top:8px;font-size:12px;padding:2px 8px;
        border:1px solid #868a92;border-radius:4px;background:#1c1e22;color:#fff;cursor:pointer">Reset view</button>
    </div>`,
  mounted() {
    try {
      this.renderer = new THREE.WebGLRenderer({
        canvas: this.$refs.canvas, antialias: true, logarithmicDepthBuffer: true, preserveDrawingBuffer: true,
      });
    } catch {
      this.$refs.legend.textContent = "This browser has no WebGL: views in space need it.";
      return;
    }
    this.camera = new THREE.PerspectiveCamera(40, 1, 1e-3, 1e10);
    this.disc = make_disc();
    this.words = new CSS2DRenderer({ element: this.$refs.words });
    this.controls = new OrbitControls(this.camera, this.$refs.canvas);
    this.controls.addEventListener("change", () => this.draw());
    this.controls.listenToKeyEvents?.(this.$refs.canvas);
    this.sizes = new ResizeObserver(() => this.resize());
    this.sizes.observe(this.$el);
    this.load();
  },
  beforeUnmount() {
    this.sizes?.disconnect();
    this.controls?.dispose();
    this.renderer?.dispose();
  },
  watch: { url() { this.load(); } },
  methods: {
    async load() {
      if (!this.renderer || !this.url) return;
      if (this.busy) { this.again = true; return; }
      this.busy = true;
      try {
        do {
          this.again = false;
          const answer = await fetch((window.path_prefix || "") + this.url);
          if (answer.ok) await this.show(await answer.arrayBuffer());
        } while (this.again);
      } finally { this.busy = false; }
    },
    async show(bytes) {
      const length = new DataView(bytes).getUint32(0, true);
      const header = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
      let offset = 4 + length;
      const scene = new THREE.Scene();
      const sky = new THREE.Group();
      let pickable = null;
      scene.background = new THREE.Color(header.paper);
      scene.add(sky);
      scene.add(new THREE.AmbientLight(0xffffff, 0.9)); // so that the side away from the Sun is seen
      const light = new THREE.DirectionalLight(0xffffff, header.sun ? 3 * header.sunlit : 2);
      light.position.set(...(header.sun || header.camera.eye));
      scene.add(light);
      for (const item of header.items) {
        if (item.kind === "earth") scene.add(make_earth(item, header.sun));
        else if (item.kind === "model") scene.add(await this.make_model(item));
        else {
          const geometry = new THREE.BufferGeometry();
          const positions = new Float32Array(bytes, offset, 3 * item.count);
          geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
          offset += 12 * item.count;
          const style = { transparent: true, opacity: item.opacity ?? 1 };
          if (item.coloured) {
            geometry.setAttribute("color", make_colours(new Uint8Array(bytes, offset, 3 * item.count)));
            offset += 4 * Math.ceil((3 * item.count) / 4);
            style.vertexColors = true;
          } else style.color = item.colour;
          if (item.kind === "lines") scene.add(new THREE.LineSegments(geometry, new THREE.LineBasicMaterial(style)));
          else {
            Object.assign(style, { size: item.size, sizeAttenuation: false });
            if (item.kind === "sky") Object.assign(style, { map: this.disc, depthWrite: false });
            if (item.on_top) style.depthTest = false;
            const points = new THREE.Points(geometry, new THREE.PointsMaterial(style));
            if (item.on_top) points.renderOrder = 1;
            if (item.pick) pickable = positions;
            if (item.kind === "sky") { points.scale.setScalar(FAR_AWAY); points.renderOrder = -1; sky.add(points); }
            else scene.add(points);
          }
        }
      }
      this.$refs.words.replaceChildren();
      this.dispose();
      Object.assign(this, { scene, sky, pickable, labels: header.labels.map((label) => this.make_label(label, header)) });
      for (const label of this.labels) (label.is_sky ? sky : scene).add(label);
      const is_new = this.header?.name !== header.name;
      this.header = header;
      this.write_legend(header);
      this.$el.dataset.ready = header.name;
      if (is_new) this.reset();
      else this.draw();
    },
    async make_model({ content, matrix }) {
      const address = (window.path_prefix || "") + this.models + content;
      if (!models.has(address)) models.set(address, load_model(address));
      const look = { vertexColors: true, side: THREE.DoubleSide, flatShading: true };
      const material = new THREE.MeshLambertMaterial({ ...look, emissive: 0x24282f }); // black parts stay above the sky
      const model = new THREE.Mesh(await models.get(address), material);
      model.matrixAutoUpdate = false;
      model.matrix.fromArray(matrix);
      return model;
    },
    make_label({ text, at, sky }, { ink, paper }) {
      const word = document.createElement("div");
      const inner = document.createElement("div"); // moved where words would overlap; three.js moves the outer one
      inner.textContent = text;
      word.append(inner);
      word.style.cssText = `color:${ink};text-shadow:0 0 3px ${paper},0 0 3px ${paper};padding-bottom:18px;white-space:nowrap`;
      const label = new CSS2DObject(word);
      label.position.set(...at).multiplyScalar(sky ? FAR_AWAY : 1);
      label.is_sky = sky;
      return label;
    },
    dispose() {
      this.scene?.traverse((object) => {
        if (object.material) object.material.dispose();
        if (object.geometry && object.matrixAutoUpdate) object.geometry.dispose();
      });
    },
    write_legend({ legend, ink, paper }) {
      const place = this.$refs.legend;
      place.replaceChildren();
      if (!legend) return;
      place.style.cssText += `;color:${ink};background:${paper}cc;padding:4px 6px;border-radius:4px`;
      const write = (text, swatch) => {
        const line = document.createElement("div");
        if (swatch) {
          const square = document.createElement("span");
          square.style.cssText = `display:inline-block;width:10px;height:10px;margin-right:6px;background:${swatch}`;
          line.append(square);
        }
        line.append(text);
        place.append(line);
      };
      write(legend.title);
      for (const [colour, text] of legend.entries || []) write(text, colour);
      if (legend.ramp) {
        const bar = document.createElement("div");
        bar.style.cssText = `width:160px;height:10px;background:linear-gradient(to right,${legend.ramp.map((c) => `rgb(${c})`)})`;
        place.append(bar);
        write(`${legend.low} to ${legend.high}`);
      }
    },
    forget() { this.header = null; }, // the next scene is seen from its own place
    reset() {
      if (!this.header) return;
      const { eye, at, up } = this.header.camera;
      this.camera.up.set(...up);
      const aspect = this.$el.clientWidth / this.$el.clientHeight || 1; // the field is 40 deg high: a narrow view is farther
      this.camera.position.set(...eye).sub(new THREE.Vector3(...at)).divideScalar(Math.min(aspect, 1));
      this.camera.position.add(new THREE.Vector3(...at));
      this.controls.dispose();
      this.controls = new OrbitControls(this.camera, this.$refs.canvas); // its upward axis is fixed when it is made
      this.controls.target.set(...at);
      this.controls.addEventListener("change", () => this.draw());
      this.controls.listenToKeyEvents?.(this.$refs.canvas);
      this.controls.update();
      this.resize();
    },
    resize() {
      const { clientWidth: width, clientHeight: height } = this.$el;
      if (!width || !height) return;
      this.renderer.setPixelRatio(window.devicePixelRatio);
      this.renderer.setSize(width, height);
      this.words.setSize(width, height);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      this.draw();
    },
    draw() {
      if (!this.scene) return;
      this.sky.position.copy(this.camera.position);
      this.renderer.render(this.scene, this.camera);
      this.words.render(this.scene, this.camera);
      this.separate_labels();
    },
    separate_labels() {
      const frame = this.$el.getBoundingClientRect();
      const taken = [];
      for (const { element } of this.labels) {
        if (element.style.display === "none") continue;
        const inner = element.firstChild;
        inner.style.transform = "";
        const { left, right, top, bottom } = inner.getBoundingClientRect();
        inner.style.visibility = "hidden";
        if (left + right < 2 * frame.left || left + right > 2 * frame.right || bottom < frame.top || top > frame.bottom) continue;
        const right_by = Math.max(frame.left + 2 - left, 0) + Math.min(frame.right - 2 - right, 0);
        const is_free = (down) => !taken.some((box) =>
          left + right_by < box.right && right + right_by > box.left && top + down < box.bottom && bottom + down > box.top);
        const down = NUDGES_PX.find(is_free);
        if (down === undefined) continue;
        inner.style.visibility = "visible";
        inner.style.transform = `translate(${right_by}px, ${down}px)`;
        taken.push({ left: left + right_by, right: right + right_by, top: top + down, bottom: bottom + down });
      }
    },
    pick({ clientX: x, clientY: y }) {
      if (!this.pickable || !this.pressed || Math.hypot(x - this.pressed[0], y - this.pressed[1]) > 3) return;
      const frame = this.$el.getBoundingClientRect();
      const place = new THREE.Vector3();
      let [nearest, least] = [-1, CLICK_PX];
      for (let k = 0; k < this.pickable.length / 3; k++) {
        place.fromArray(this.pickable, 3 * k).project(this.camera);
        const distance = Math.hypot(
          frame.left + (place.x + 1) * frame.width / 2 - x, frame.top + (1 - place.y) * frame.height / 2 - y);
        if (place.z < 1 && distance < least) [nearest, least] = [k, distance];
      }
      if (nearest >= 0) this.$emit("pick", nearest);
    },
  },
};
