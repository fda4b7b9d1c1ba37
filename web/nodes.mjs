// Functions in GLSL, from standard input, as nodes for three's WebGPURenderer (TSL): by three's own transpiler.
import { readFileSync } from "node:fs";
import GLSLDecoder from "three/examples/jsm/transpiler/GLSLDecoder.js";
import Transpiler from "three/examples/jsm/transpiler/Transpiler.js";
import TSLEncoder from "three/examples/jsm/transpiler/TSLEncoder.js";

process.stdout.write(new Transpiler(new GLSLDecoder(), new TSLEncoder()).parse(readFileSync(0, "utf8")));
