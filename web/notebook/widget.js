// The widget of `tl.view`: the viewer in a notebook, whose media and camera are the model's. An anywidget module (AFM).
import { createViewer } from "../src/viewer/index.js";

/** Milliseconds between what a drag tells Python. */
const REST = 80;

const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

/** Bytes of a trait, which comes as a DataView, a buffer, or base64. */
function bytesOf(value) {
  if (value instanceof DataView) return new Uint8Array(value.buffer, value.byteOffset, value.byteLength);
  return value;
}

function render({ model, el }, create = createViewer) {
  const box = document.createElement("div");
  box.style.cssText = `position:relative;width:100%;height:${model.get("_height")}px;background:#131416;overflow:hidden`;
  box.setAttribute("role", "region");
  box.setAttribute("aria-label", model.get("_label"));
  el.append(box);
  let viewer, timer, ended = false, taking = false;

  const media = () => viewer.state().media.map(({ extinction, ior, roughness, distance }) => ({
    extinction: [...extinction], ior, roughness, distance,
  }));
  const camera = () => {
    const { eye, target, up } = viewer.state().camera;
    return { eye: [...eye], target: [...target], up: [...up] };
  };

  const tell = () => {
    timer = undefined;
    if (ended) return;
    const found = { _media: media(), _camera: camera() };
    let changed = false;
    for (const [name, value] of Object.entries(found)) {
      if (same(value, model.get(name))) continue;
      model.set(name, value);
      changed = true;
    }
    if (changed) model.save_changes();
  };

  const takeMedia = () => {
    if (!viewer) return;
    taking = true;
    const shown = media();
    model.get("_media").forEach((wanted, i) => {
      if (!same(wanted, shown[i])) viewer.setMaterial(wanted, i);
    });
    taking = false;
  };
  const takeCamera = () => {
    const wanted = model.get("_camera");
    if (!viewer || !wanted.eye || same(wanted, camera())) return;
    taking = true;
    viewer.setCamera(wanted);
    taking = false;
  };
  const refuse = (error) => {
    const told = document.createElement("p");
    told.setAttribute("role", "alert");
    told.style.cssText = "color:#f0f1f3;padding:1em;margin:0";
    told.textContent = `This scene cannot be shown: ${error.message}.`;
    box.replaceChildren(told);
    model.set("problem", String(error.message));
    model.save_changes();
  };

  const ready = create(box, bytesOf(model.get("_payload"))).then((made) => {
    viewer = made;
    if (ended) return viewer.dispose();
    takeMedia();
    // A second view of the model, or one that is shown again, begins where the first one is.
    if (model.get("_moved")) takeCamera();
    viewer.onChange(() => {
      if (!taking) timer ??= setTimeout(tell, REST);
    });
    model.on("change:_media", takeMedia);
    model.on("change:_camera", takeCamera);
    return viewer;
  }).catch(refuse);

  const end = () => {
    ended = true;
    clearTimeout(timer);
    model.off("change:_media", takeMedia);
    model.off("change:_camera", takeCamera);
    viewer?.dispose();
    box.remove();
  };
  end.ready = ready;
  return end;
}

export { render };
export default { render };
