// A view in space of a scene that Python packs: header as JSON, then positions and colours (see picture/viewers/space_scene.py).
import { CSS2DObject, CSS2DRenderer, OrbitControls, THREE } from "nicegui-scene";

const models = new Map(); // geometries of targets by address, kept while the page lives

async function load_model(address) {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error(`${address}: ${answer.status}`);
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(await answer.arrayBuffer()), 3));
  geometry.computeVertexNormals();
  return geometry;
}

export default {
  props: { url: String, models: String, label: String },
  template: `
    <div style="position:relative;width:100%;height:100%;min-height:200px;overflow:hidden">
      <canvas ref="canvas" tabindex="0" role="img" :aria-label="label" style="display:block;position:absolute"></canvas>
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
    this.camera = new THREE.PerspectiveCamera(40, 1, 1e-3, 1e8);
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
      scene.background = new THREE.Color(header.paper);
      const lit = Boolean(header.sun);
      scene.add(new THREE.AmbientLight(0xffffff, header.ambient ?? 0.9));
      const light = new THREE.DirectionalLight(0xffffff, lit ? 3 : 2);
      light.position.set(...(header.sun || header.camera.eye));
      scene.add(light);
      for (const item of header.items) {
        let object;
        if (item.kind === "sphere") {
          const material = new THREE.MeshLambertMaterial({ color: item.colour });
          object = new THREE.Mesh(new THREE.SphereGeometry(item.radius, 96, 64), material);
        } else if (item.kind === "model") {
          const address = (window.path_prefix || "") + this.models + item.content;
          if (!models.has(address)) models.set(address, load_model(address));
          const material = new THREE.MeshLambertMaterial({ color: item.colour, side: THREE.DoubleSide, flatShading: true });
          object = new THREE.Mesh(await models.get(address), material);
          object.matrixAutoUpdate = false;
          object.matrix.fromArray(item.matrix);
        } else {
          const geometry = new THREE.BufferGeometry();
          geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(bytes, offset, 3 * item.count), 3));
          offset += 12 * item.count;
          const style = { transparent: true, opacity: item.opacity ?? 1 };
          if (item.coloured) {
            const colour = new THREE.Color();
            const rgb = new Uint8Array(bytes, offset, 3 * item.count);
            const linear = new Float32Array(rgb.length);
            for (let k = 0; k < rgb.length; k += 3) {
              colour.setRGB(rgb[k] / 255, rgb[k + 1] / 255, rgb[k + 2] / 255, THREE.SRGBColorSpace).toArray(linear, k);
            }
            geometry.setAttribute("color", new THREE.BufferAttribute(linear, 3));
            offset += 4 * Math.ceil((3 * item.count) / 4);
            style.vertexColors = true;
          } else style.color = item.colour;
          object = item.kind === "points"
            ? new THREE.Points(geometry, new THREE.PointsMaterial({ ...style, size: item.size, sizeAttenuation: false }))
            : new THREE.LineSegments(geometry, new THREE.LineBasicMaterial(style));
        }
        scene.add(object);
      }
      this.$refs.words.replaceChildren();
      for (const { text, at } of header.labels) {
        const word = document.createElement("div");
        word.textContent = text;
        word.style.cssText = `color:${header.ink};text-shadow:0 0 3px ${header.paper},0 0 3px ${header.paper};padding-bottom:18px`;
        const object = new CSS2DObject(word);
        object.position.set(...at);
        scene.add(object);
      }
      this.dispose();
      this.scene = scene;
      const is_new = this.header?.name !== header.name;
      this.header = header;
      this.write_legend(header);
      this.$el.dataset.ready = header.name;
      if (is_new) this.reset();
      else this.draw();
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
      this.renderer.render(this.scene, this.camera);
      this.words.render(this.scene, this.camera);
    },
  },
};
