// What fragments know of their body, from body.vert: it is alike for all of them. Software rasterizers look each uniform up for
// each fragment, which took as long as all else that adding up does. Names are those of the block <Body>, but for its slot.

flat in vec4 counting;
flat in vec4 to_axial_depth;
flat in vec4 medium_of_body;

#define count_weight counting.x
#define count_offset counting.y
#define axial_start counting.z
#define snapping_share counting.w
#define axial_depth_scale to_axial_depth.x
#define axial_depth_start to_axial_depth.y
#define subpixel to_axial_depth.z
#define slot_of_body int(to_axial_depth.w)
#define extinction medium_of_body
#define starts_unknown int(medium_of_body.w)
