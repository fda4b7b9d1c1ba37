/** A physical node material whose light crosses what is really there: the thickness of a ThicknessNode, not a constant. */
import { MeshPhysicalNodeMaterial, PhysicalLightingModel, Vector3 } from "three/webgpu";
import type { MeshPhysicalNodeMaterialParameters, NodeBuilder, Texture } from "three/webgpu";
import * as tsl from "three/tsl";
import { TranslucentError } from "../errors.js";
import { extinctionOf } from "../extinction.js";
import { fresnel_dielectric, reflected_direction, refracted_direction } from "../generated/nodes.js";
import { ThicknessNode } from "./ThicknessNode.js";
import type { Nodes } from "./programs.js";

const { Break, Fn, If, Loop, cameraProjectionMatrix, cameraViewMatrix, cameraWorldMatrix, diffuseColor, float, int, ior } = tsl as Nodes;
const { ivec2, materialEnvIntensity, normalView, pmremTexture, positionView, roughness, screenUV, select, textureBicubicLevel } = tsl as Nodes;
const { materialThickness, textureLoad, transmission, uniform, vec2, vec3, vec4, viewportOpaqueMipTexture } = tsl as Nodes;
const { clamp, dot, exp, length, log2, max, mix, normalize } = tsl as Nodes;

const STEPS = 16;
const HALVINGS = 5;

export interface TranslucentNodeMaterialParameters extends MeshPhysicalNodeMaterialParameters {
  /** The node that measures the scene. */
  thicknessNode: ThicknessNode;
}

const isOrthographic = cameraProjectionMatrix.element(3).w.equal(1);

/** Place of a point of the camera's axes in the picture: 0 to 1, from the top left. */
const placeOf = (p: Nodes): Nodes => {
  const clip = cameraProjectionMatrix.mul(vec4(p, 1));
  return clip.xy.div(clip.w).mul(vec2(0.5, -0.5)).add(0.5);
};

/** Point of the camera's axes at a place of the picture, so many metres along the axis. */
const pointOf = (place: Nodes, axial: Nodes): Nodes => {
  const ndc = place.mul(2).sub(1).mul(vec2(1, -1));
  const scale = vec2(cameraProjectionMatrix.element(0).x, cameraProjectionMatrix.element(1).y);
  const parallel = ndc.sub(cameraProjectionMatrix.element(3).xy).div(scale);
  const central = ndc.add(cameraProjectionMatrix.element(2).xy).mul(axial).div(scale);
  return vec3(select(isOrthographic, parallel, central), axial.negate());
};

/** Light that comes through from behind, bent where it enters and where it leaves the last surface: see TranslucentMaterial. */
class ExactLightingModel extends PhysicalLightingModel {
  constructor(
    private readonly material: TranslucentNodeMaterial,
    ...others: ConstructorParameters<typeof PhysicalLightingModel>
  ) {
    super(...others);
  }

  override start(builder: NodeBuilder): void {
    const { context } = builder as Nodes;
    const transmits = this.transmission;
    if (transmits) {
      context.backdrop = this.through(builder);
      context.backdropAlpha = transmission;
    }
    this.transmission = false; // three's own
    super.start(builder);
    this.transmission = transmits;
    // What three.js mirrors by Schlick's approximation, as Fresnel has it: at ior 1, nothing.
    const cosine = clamp(dot(normalView, this.ray().negate()), 0, 1).toVar();
    const ratio = ior.sub(1).div(ior.add(1));
    const schlick = mix(cosine.oneMinus().pow(5), 1, ratio.mul(ratio));
    const fresnel = fresnel_dielectric(cosine, ior).div(max(schlick, 1e-6)).toVar();
    context.reflectedLight.directSpecular.mulAssign(fresnel);
    context.reflectedLight.indirectSpecular.mulAssign(fresnel);
  }

  private ray(): Nodes {
    return select(isOrthographic, vec3(0, 0, -1), normalize(positionView));
  }

  private through(builder: NodeBuilder): Nodes {
    const { extinction } = this.material;
    const { exits, ends, texture: paths, opticalDepth, diagonal, has, pixels } = this.material.thicknessNode;
    const texel = (from: Texture, place: Nodes): Nodes => textureLoad(from, ivec2(clamp(place.mul(pixels), vec2(0), pixels.sub(1))), int(0));
    const within = (place: Nodes): Nodes => place.equal(clamp(place, vec2(0), vec2(1))).all();
    const isInside = (p: Nodes): Nodes => {
      const place = placeOf(p).toVar();
      return within(place).and(p.z.negate().lessThanEqual(texel(exits, place).a));
    };
    const view = (direction: Nodes): Nodes => cameraViewMatrix.mul(vec4(direction, 0)).xyz;
    return Fn(() => {
      const p = positionView;
      const place = screenUV;
      const path = texel(paths, place).toVar();
      const valid = path.b.greaterThan(0.5).toVar();
      const thickness = select(valid, path.r, materialThickness).toVar();
      const ray = this.ray().toVar();
      // Smooth normals may look away at an outline.
      const n = normalize(normalView.sub(ray.mul(max(dot(ray, normalView).add(0.05), 0)))).toVar();
      const inside = refracted_direction(ray, n, ior).toVar();
      const kept = fresnel_dielectric(dot(ray, n).negate(), ior).oneMinus().toVar();
      const along = float(thickness).toVar();
      const filled = float(1).toVar();
      const crossings = float(1).toVar();
      const longest = float(1e30).toVar();
      const outside = vec3(inside).toVar();
      If(has.exits.greaterThan(0).and(valid), () => {
        // To where the bent ray is behind the last surface: in steps, then halving them, then by the tangent plane there.
        const reach = length(pointOf(place, texel(exits, place).a).sub(p));
        const low = float(0).toVar();
        const high = float(diagonal).toVar();
        Loop({ start: int(1), end: int(STEPS), condition: "<=" }, ({ i }: { i: Nodes }) => {
          const at = diagonal.mul(float(i)).div(STEPS).toVar();
          If(isInside(p.add(inside.mul(at))).not(), () => {
            high.assign(at);
            Break();
          });
          low.assign(at);
        });
        Loop(HALVINGS, () => {
          const at = low.add(high).mul(0.5).toVar();
          If(isInside(p.add(inside.mul(at))), () => {
            low.assign(at);
          }).Else(() => {
            high.assign(at);
          });
        });
        const there = placeOf(p.add(inside.mul(low))).toVar();
        const exit = texel(exits, there).toVar();
        const normal = view(exit.xyz).toVar();
        const slope = dot(inside, normal).toVar();
        along.assign(low);
        If(exit.a.greaterThan(0).and(slope.greaterThan(0.05)), () => {
          const tangent = dot(pointOf(there, exit.a).sub(p), normal).div(slope);
          const step = diagonal.div(STEPS);
          along.assign(max(clamp(tangent, low.sub(step), high.add(step)), 0));
        });
        // Of the way to the last surface, the share that is inside. Where a strand ends before another the bent ray crosses a
        // gap: no more than is on either, and on as the ray came.
        filled.assign(select(reach.greaterThan(thickness), thickness.div(reach), 1));
        const other = texel(paths, there).toVar();
        longest.assign(max(thickness, select(other.b.greaterThan(0.5), other.r, 0)).div(max(dot(inside, ray), 0.1)));
        const gap = along.mul(filled).greaterThan(longest).toVar();
        If(gap, () => {
          outside.assign(ray);
        });
        If(gap.not().and(dot(normal, normal).greaterThan(0.25)).and(slope.greaterThan(0)), () => {
          const unit = normalize(normal).toVar();
          const cosine = dot(inside, unit);
          const leaving = refracted_direction(inside, unit.negate(), ior.reciprocal()).toVar();
          const leaves = dot(leaving, leaving).greaterThan(0.25).toVar();
          outside.assign(select(leaves, leaving, reflected_direction(inside, unit.negate())));
          kept.mulAssign(select(leaves, fresnel_dielectric(cosine, ior.reciprocal()).oneMinus(), 1));
          crossings.assign(select(leaves, 1, 2)); // mirrored inside, it goes as far again
        });
      });
      // Per metre of the straight ray, of all media on it.
      const several = has.opticalDepth.greaterThan(0).and(thickness.greaterThan(0));
      const sigma = select(several, texel(opticalDepth, place).rgb.div(max(thickness, 1e-30)), extinction);
      const depth = sigma.mul(along.mul(filled).min(longest).mul(crossings));
      const behind = this.behind(builder, p.add(inside.mul(along)), outside, (at) => texel(ends, at).g.greaterThan(0).and(within(at)));
      return vec4(kept.mul(exp(depth.min(1e4).negate())).mul(behind).mul(diffuseColor.rgb), 1);
    })();
  }

  /** Background: an opaque object where the picture shows one, else the environment, else the picture all the same. */
  private behind(builder: NodeBuilder, p: Nodes, direction: Nodes, isOpaque: (place: Nodes) => Nodes): Nodes {
    const place = placeOf(p).toVar();
    const { has } = this.material.thicknessNode;
    const rough = roughness.mul(clamp(ior.mul(2).sub(2), 0, 1)).toVar();
    const lod = log2((tsl as Nodes).screenSize.x).mul(rough);
    const seen = textureBicubicLevel(viewportOpaqueMipTexture().sample(place), lod).rgb;
    const { envMap, envNode } = this.material;
    let sky: Nodes = envNode ?? envMap ?? (builder as Nodes).environmentNode;
    if (!sky) return seen;
    if (sky.isTextureNode) sky = pmremTexture(sky.value);
    else if (sky.isTexture) sky = pmremTexture(sky);
    const world = direction.transformDirection(cameraWorldMatrix);
    const radiance = sky.context({ getUV: () => world, getTextureLevel: () => rough }).mul(materialEnvIntensity);
    return select(has.ends.greaterThan(0).and(isOpaque(place)), seen, radiance.rgb ?? radiance);
  }
}

/**
 * MeshPhysicalNodeMaterial, but light that comes through is absorbed along what a ThicknessNode measured: attenuationColor
 * is what is left after attenuationDistance. Rays bend where they enter, and where they leave the last surface. Where no
 * number can be trusted (an open mesh), `thickness` stands in.
 */
export class TranslucentNodeMaterial extends MeshPhysicalNodeMaterial {
  readonly isTranslucentMaterial = true;
  declare thicknessNode: ThicknessNode;
  /** Extinction in 1/m, per channel, as the material has it now. */
  readonly extinction: Nodes = uniform(new Vector3()).onObjectUpdate((_: unknown, self: Nodes) => {
    self.value.fromArray(extinctionOf(this));
  });

  static override get type(): string {
    return "TranslucentNodeMaterial";
  }

  constructor(parameters: TranslucentNodeMaterialParameters) {
    if (!(parameters?.thicknessNode instanceof ThicknessNode)) {
      throw new TranslucentError("TranslucentNodeMaterial", "it has no ThicknessNode", "give one: { thicknessNode: thickness() }");
    }
    super();
    this.setValues({ transmission: 1, roughness: 0, metalness: 0, ...parameters });
  }

  override setupLightingModel(): PhysicalLightingModel {
    const { useClearcoat, useSheen, useIridescence, useAnisotropy, useTransmission, useDispersion } = this;
    return new ExactLightingModel(this, useClearcoat, useSheen, useIridescence, useAnisotropy, useTransmission, useDispersion);
  }

  override clone(): this {
    return new TranslucentNodeMaterial({ thicknessNode: this.thicknessNode }).copy(this) as this;
  }
}
