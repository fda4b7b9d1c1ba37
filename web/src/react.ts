/** Exact thickness for react-three-fiber: a pass around a scene, and the material that absorbs light by it. */
import { createContext, createElement, useContext, useEffect, useLayoutEffect, useMemo } from "react";
import type { ReactElement, ReactNode, Ref } from "react";
import { useThree } from "@react-three/fiber";
import type { ColorRepresentation, WebGLRenderer } from "three";
import { ExactThicknessPass, TranslucentError, TranslucentMaterial as Material } from "./index.js";
import type { ExactThicknessOptions, TranslucentMaterialParameters } from "./index.js";

const Pass = createContext<ExactThicknessPass | null>(null);

export interface ExactThicknessProps extends ExactThicknessOptions {
  children?: ReactNode;
}

/**
 * Measures the scene before each picture of it, whatever draws it and by which camera. Around everything that has a
 * `TranslucentMaterial`, within a Canvas; the props are the options of ExactThicknessPass.
 */
export function ExactThickness({ children, ...options }: ExactThicknessProps): ReactElement {
  const renderer = useThree((state) => state.gl) as WebGLRenderer;
  const scene = useThree((state) => state.scene);
  // Options by themselves: a pass is made once, and keeps what it has on the graphics card.
  const pass = useMemo(() => new ExactThicknessPass(renderer), [renderer]);
  useLayoutEffect(() => {
    pass.options = options;
  });
  useEffect(() => {
    const before = scene.onBeforeRender;
    scene.onBeforeRender = (...all) => {
      before.apply(scene, all);
      pass.render(scene, all[2]);
    };
    return () => {
      scene.onBeforeRender = before;
      pass.dispose();
    };
  }, [scene, pass]);
  return createElement(Pass.Provider, { value: pass }, children);
}

/** The pass of the `ExactThickness` around a component: its textures, `at(x, y)` and `read()`. */
export function useExactThickness(): ExactThicknessPass {
  const pass = useContext(Pass);
  if (!pass) throw new TranslucentError("useExactThickness()", "no <ExactThickness> is around it", "put one around what is translucent, in the Canvas");
  return pass;
}

type Given = Omit<TranslucentMaterialParameters, "pass" | "attenuationColor" | "color">;

export interface TranslucentMaterialProps extends Given {
  attenuationColor?: ColorRepresentation;
  color?: ColorRepresentation;
  /** Where it goes on the parent. Default: "material". */
  attach?: string;
  ref?: Ref<Material>;
}

/** A child of a mesh: MeshPhysicalMaterial with the thickness that the `ExactThickness` around it measured. */
export function TranslucentMaterial(props: TranslucentMaterialProps): ReactElement {
  const pass = useContext(Pass);
  if (!pass) throw new TranslucentError("<TranslucentMaterial>", "no <ExactThickness> is around it", "put one around what is translucent, in the Canvas");
  const material = useMemo(() => new Material({ pass }), [pass]);
  useEffect(() => () => material.dispose(), [material]);
  return createElement("primitive", { attach: "material", ...props, object: material });
}
