/** The meshes of a scene that fill space or end rays, and their stand-ins in the scenes that the pass draws. */
import { Box3, InstancedMesh, Matrix4, Mesh, SkinnedMesh } from "three";
import type { BufferGeometry, Camera, Material, Object3D, Vector3 } from "three";
import { TranslucentError, nameOf } from "./errors.js";
import { extinctionOf, materials } from "./extinction.js";
import { NOTHING } from "./generated/shaders.js";
import type { ThicknessOptions } from "./options.js";
import type { BodyUniforms } from "./uniforms.js";

/** A mesh as the pass draws it: one geometry, other materials; nothing of the user's own scene is touched. */
export class StandIn {
  readonly box = new Box3();
  readonly worldBox = new Box3();
  private drawn: Mesh | null = null;
  private geometry: BufferGeometry | null = null;
  private readonly made = new Map<string, Material>();

  constructor(
    readonly mesh: Mesh,
    readonly uniforms: BodyUniforms,
  ) {}

  get instanced(): InstancedMesh | null {
    return (this.mesh as InstancedMesh).isInstancedMesh ? (this.mesh as InstancedMesh) : null;
  }

  get skinned(): SkinnedMesh | null {
    return (this.mesh as SkinnedMesh).isSkinnedMesh ? (this.mesh as SkinnedMesh) : null;
  }

  /** Bounds now, in the mesh's own coordinates and in the world's. */
  measure(): void {
    const { mesh, instanced, skinned } = this;
    if (skinned) {
      skinned.skeleton.update(); // bones as they are now
      skinned.computeBoundingBox();
      this.box.copy(skinned.boundingBox!);
    } else if (instanced) {
      instanced.computeBoundingBox();
      this.box.copy(instanced.boundingBox!);
    } else {
      if (!mesh.geometry.boundingBox) mesh.geometry.computeBoundingBox();
      this.box.copy(mesh.geometry.boundingBox!);
    }
    this.worldBox.copy(this.box).applyMatrix4(mesh.matrixWorld);
  }

  /** The stand-in, with this material; it is made once for each `key`. */
  use(key: string, make: () => Material): Mesh {
    const standIn = this.object();
    const material = this.made.get(key) ?? make();
    this.made.set(key, material);
    standIn.material = material;
    return standIn;
  }

  private object(): Mesh {
    const { mesh, instanced, skinned } = this;
    if (!this.drawn || this.geometry !== mesh.geometry) {
      this.geometry = mesh.geometry;
      if (skinned) this.drawn = new SkinnedMesh(mesh.geometry);
      else if (instanced) this.drawn = new InstancedMesh(mesh.geometry, undefined, 0);
      else this.drawn = new Mesh(mesh.geometry);
      this.drawn.frustumCulled = false;
      this.drawn.matrixAutoUpdate = this.drawn.matrixWorldAutoUpdate = false;
    }
    const drawn = this.drawn;
    drawn.matrixWorld.copy(mesh.matrixWorld); // mirrors it, too: three.js then turns the sides of faces
    drawn.morphTargetInfluences = mesh.morphTargetInfluences;
    if (skinned) {
      const copy = drawn as SkinnedMesh;
      copy.skeleton = skinned.skeleton;
      copy.bindMode = skinned.bindMode;
      copy.bindMatrix.copy(skinned.bindMatrix);
      copy.bindMatrixInverse.copy(skinned.bindMatrixInverse);
    } else if (instanced) {
      const copy = drawn as InstancedMesh;
      copy.instanceMatrix = instanced.instanceMatrix;
      copy.morphTexture = instanced.morphTexture;
      copy.count = instanced.count;
    }
    return drawn;
  }

  dispose(): void {
    for (const material of this.made.values()) material.dispose();
    this.made.clear();
    this.drawn = null;
  }
}

/** Winding number that instances, or the mesh itself, have around a point of the mesh's coordinates, by `number` of one of them. */
export function sumOfInstances(mesh: Mesh, point: Vector3, number: (point: Vector3) => number): number {
  const instanced = mesh as InstancedMesh;
  if (!instanced.isInstancedMesh) return number(point);
  let sum = 0;
  const matrix = new Matrix4();
  for (let i = 0; i < instanced.count; i++) {
    instanced.getMatrixAt(i, matrix);
    if (matrix.determinant() !== 0) sum += number(point.clone().applyMatrix4(matrix.invert()));
  }
  return sum;
}

/** All visible meshes at and below an object, that a camera sees the layers of. */
export function visibleMeshes(root: Object3D, camera: Camera): Mesh[] {
  const found: Mesh[] = [];
  const visit = (object: Object3D): void => {
    if (!object.visible) return;
    if ((object as Mesh).isMesh && object.layers.test(camera.layers)) found.push(object as Mesh);
    object.children.forEach(visit);
  };
  visit(root);
  return found;
}

/** Refuse what has no inside that this pass can measure. */
export function checkBody(object: Object3D): asserts object is Mesh {
  const name = nameOf(object);
  const flags = object as unknown as Record<string, boolean>;
  if (!flags.isMesh) throw new TranslucentError(name, "it has no triangles, so no inside", "give meshes as bodies");
  if (flags.isBatchedMesh) {
    throw new TranslucentError(name, "batches have a transform per part that passes do not know", "use meshes or an InstancedMesh");
  }
  const { geometry } = object as Mesh;
  if (!geometry.getAttribute("position")) {
    throw new TranslucentError(name, "its geometry has no positions", "give a geometry with triangles");
  }
}

/** Stand-ins of the meshes of a scene, kept from picture to picture. */
export class StandIns {
  private kept = new Map<Mesh, StandIn>();

  constructor(private readonly uniforms: () => BodyUniforms) {}

  /** Bodies, and what ends rays. */
  sort(scene: Object3D, camera: Camera, { bodies, opaque }: ThicknessOptions): [StandIn[], StandIn[]] {
    const all = visibleMeshes(scene, camera);
    const chosen = Array.isArray(bodies) ? below(bodies, camera) : all.filter(bodies ?? isTranslucent);
    chosen.forEach(checkBody);
    const inside = new Set<Mesh>(chosen);
    const ends = Array.isArray(opaque) ? below(opaque, camera) : all.filter(opaque ?? endsRays);
    const kept = new Map<Mesh, StandIn>();
    const standIn = (mesh: Mesh): StandIn => {
      const one = kept.get(mesh) ?? this.kept.get(mesh) ?? new StandIn(mesh, this.uniforms());
      kept.set(mesh, one);
      return one;
    };
    const sorted: [StandIn[], StandIn[]] = [
      chosen.map(standIn),
      ends.filter((mesh) => !inside.has(mesh) && mesh.geometry.getAttribute("position")).map(standIn),
    ];
    for (const [mesh, one] of this.kept) if (!kept.has(mesh)) one.dispose();
    this.kept = kept;
    return sorted;
  }

  dispose(): void {
    for (const one of this.kept.values()) one.dispose();
    this.kept.clear();
  }
}

/** Tell whether bodies are of several media. */
export function areSpectral(bodies: StandIn[]): boolean {
  return new Set(bodies.map((one) => extinctionOf(materials(one.mesh)[0]).join())).size > 1;
}

/** Denser than this is opaque anyway, and its products stay finite. */
export function setExtinction(one: StandIn, diagonal: number): void {
  const [r, g, b] = extinctionOf(materials(one.mesh)[0]).map((sigma) => Math.min(sigma, NOTHING / diagonal));
  one.uniforms.extinction.value.set(r, g, b, 0);
}

export function bends(mesh: Mesh): boolean {
  return materials(mesh).some((one) => ((one as { ior?: number }).ior ?? 1) > 1);
}

function below(roots: Object3D[], camera: Camera): Mesh[] {
  for (const root of roots) if (root.children.length === 0) checkBody(root);
  return [...new Set(roots.flatMap((root) => visibleMeshes(root, camera)))];
}

function isTranslucent(mesh: Mesh): boolean {
  return materials(mesh).some((one) => (one as { isTranslucentMaterial?: boolean }).isTranslucentMaterial);
}

function endsRays(mesh: Mesh): boolean {
  const all = materials(mesh);
  const transmissive = (one: Material): boolean => ((one as { transmission?: number }).transmission ?? 0) > 0;
  return all.every((one) => one.visible && one.depthWrite && !one.transparent && !transmissive(one));
}
