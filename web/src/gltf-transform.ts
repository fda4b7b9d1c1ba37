/// <reference types="node" />
/** Metric thickness in pipelines of glTF-Transform, by the rules of `translucent material check --fix`: the command does the work. */
import { execFile } from "node:child_process";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { NodeIO } from "@gltf-transform/core";
import type { Document, Extension, Transform } from "@gltf-transform/core";
import { createTransform, mergeDocuments } from "@gltf-transform/functions";
import { TranslucentError } from "./errors.js";

/** What is wrong with a material, and what to do about it. */
export interface MaterialFinding {
  severity: "error" | "warning" | "note";
  code: string;
  where: string;
  text: string;
  do: string;
}

export interface MetricThicknessOptions {
  /** How the command line of translucent is called; an array has its first arguments. Default: "translucent", on the PATH. */
  command?: string | string[];
  /** Texels along a side of baked maps. Default: 512. */
  size?: number;
  /** Rays from each texel. Default: 64. */
  rays?: number;
  /** Hears what is left to do, which nobody but the author of the model can decide: holes, units, colors. Default: the logger. */
  onFindings?: (findings: MaterialFinding[]) => void;
}

/**
 * Bake the thickness of bodies that light passes where the document states a wrong one, in metres, and mend what hides it.
 *
 * `await document.transform(metricThickness())`. It calls `translucent material check --fix`, a Python package (`pip install
 * translucent-shading[all]`), on a copy in a temporary folder. Documents that are right stay as they are. Before functions that
 * compress meshes: what is compressed cannot be measured.
 */
export function metricThickness(options: MetricThicknessOptions = {}): Transform {
  const known = ["command", "size", "rays", "onFindings"];
  const unknown = Object.keys(options).find((name) => !known.includes(name));
  if (unknown) throw new TranslucentError(`option ${unknown} of metricThickness`, "there is no such option", `use one of ${known.join(", ")}`);
  const { command = "translucent", size = 512, rays = 64, onFindings } = options;
  return createTransform("metricThickness", async (document: Document): Promise<void> => {
    const used = document.getRoot().listExtensionsUsed();
    const io = new NodeIO().registerExtensions(used.map((one) => one.constructor as unknown as typeof Extension));
    const folder = await mkdtemp(join(tmpdir(), "translucent-"));
    try {
      const [from, to] = [join(folder, "model.glb"), join(folder, "fixed.glb")];
      await io.write(from, document);
      const given = ["material", "check", from, "--fix", "-o", to, "--json", "--size", String(size), "--rays", String(rays)];
      const { before, left } = await check([command].flat(), given);
      if (before.length > 0) replace(document, await io.read(to));
      if (onFindings) onFindings(left);
      else for (const one of left) document.getLogger().warn(`metricThickness: ${one.where}: ${one.text}; ${one.do}`);
    } finally {
      await rm(folder, { recursive: true, force: true });
    }
  });
}

/** Findings in the file, and in the one that was mended. */
function check([program, ...first]: string[], given: string[]): Promise<{ before: MaterialFinding[]; left: MaterialFinding[] }> {
  return new Promise((resolve, reject) => {
    execFile(program, [...first, ...given], { maxBuffer: 2 ** 28 }, (error, stdout, stderr) => {
      if ((error as NodeJS.ErrnoException | null)?.code === "ENOENT") {
        const todo = "pip install translucent-shading[all], or say where it is: metricThickness({ command })";
        return reject(new TranslucentError("metricThickness", `there is no command ${program}`, todo));
      }
      try {
        // It exits with 1 where errors are left, which findings tell as well.
        const { findings, fixed } = JSON.parse(stdout) as { findings: MaterialFinding[]; fixed: { findings: MaterialFinding[] } };
        resolve({ before: findings, left: fixed.findings });
      } catch {
        reject(new TranslucentError("metricThickness", stderr.trim().replace(/^error: /, "") || String(error), "see what `translucent material check` says of the file"));
      }
    });
  });
}

/** Give a document what another one holds. */
function replace(document: Document, fixed: Document): void {
  const root = document.getRoot();
  const scenes = root.listScenes();
  const shown = scenes.indexOf(root.getDefaultScene() ?? scenes[0]);
  const lists = [root.listAnimations(), root.listSkins(), scenes, root.listNodes(), root.listMeshes(), root.listCameras()];
  const all = [...lists, root.listMaterials(), root.listTextures(), root.listAccessors(), root.listBuffers()];
  all.flat().forEach((one) => one.dispose());
  root.listExtensionsUsed().forEach((one) => one.dispose());
  mergeDocuments(document, fixed);
  root.setDefaultScene(root.listScenes()[shown] ?? null);
}
