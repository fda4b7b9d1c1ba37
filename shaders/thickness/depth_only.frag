// Writes nothing but the depth buffer: the floor of what drawing this geometry costs.

void main() {
}
