uniform sampler2D light_map;  // the environment that lights, as it is
