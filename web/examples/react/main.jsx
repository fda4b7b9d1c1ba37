// Wine in the shape of a knot, and whisky after a click, with react-three-fiber. In a project of your own the import is "translucent-three/react".
import { useRef, useState } from "react";
import { createRoot } from "react-dom/client";
import { Canvas, useFrame } from "@react-three/fiber";
import { ExactThickness, TranslucentMaterial, useExactThickness } from "../../src/react.js";

const DRINKS = [["#7b1e3a", 0.01], ["#c7792b", 0.02]];

function Knot({ drink: [color, distance] }) {
  const mesh = useRef();
  useFrame((_, seconds) => {
    mesh.current.rotation.y += seconds / 3;
  });
  return (
    <mesh ref={mesh}>
      <torusKnotGeometry args={[0.02, 0.006, 128, 24]} />
      <TranslucentMaterial ior={1.33} attenuationColor={color} attenuationDistance={distance} />
    </mesh>
  );
}

// For the console: Math.max(...pass.read().thickness) is in metres.
function Console() {
  globalThis.pass = useExactThickness();
}

function Scene() {
  const [drink, setDrink] = useState(0);
  return (
    <Canvas camera={{ position: [0, 0, 0.15], fov: 30, near: 0.01, far: 1 }} onClick={() => setDrink(1 - drink)}>
      <color attach="background" args={["#c8d0d8"]} />
      <directionalLight intensity={2} />
      <ExactThickness>
        <Knot drink={DRINKS[drink]} />
        <Console />
      </ExactThickness>
    </Canvas>
  );
}

createRoot(document.getElementById("root")).render(<Scene />);
