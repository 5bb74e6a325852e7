// Draws a data file, or a grid that the program makes itself, on a device of the library's own, and writes the picture:
//
//     draw FILE|- OUT.ppm [TECHNIQUE]

#include <volraster.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

template <auto destroy> struct Destroy {
    template <typename T> void operator()(T *handle) const { destroy(handle); }
};
using Gpu = std::unique_ptr<vr_gpu, Destroy<vr_gpu_destroy>>;
using Scene = std::unique_ptr<vr_scene, Destroy<vr_scene_destroy>>;

// Turns errors into exceptions.
void check(vr_result result, const char *call) {
    if (result < 0) throw std::runtime_error(std::string(call) + ": " + vr_last_error());
}

template <typename T> T sized() {
    T structure{};
    structure.struct_size = sizeof structure;
    return structure;
}

Gpu open() {
    vr_gpu *gpu = nullptr;
    check(vr_gpu_create(nullptr, &gpu), "vr_gpu_create");
    return Gpu(gpu);
}

Scene load(vr_gpu *gpu, const std::string &path) {
    vr_scene *scene = nullptr;
    check(vr_scene_load(gpu, path.c_str(), nullptr, &scene), "vr_scene_load");
    return Scene(scene);
}

// A ball of fog in a grid of 32 x 32 x 32 bytes.
Scene ball(vr_gpu *gpu) {
    const unsigned side = 32;
    std::vector<unsigned char> samples(side * side * side);
    for (unsigned i = 0; i < samples.size(); ++i) {
        const double x = i % side - 15.5, y = i / side % side - 15.5, z = i / side / side - 15.5;
        samples[i] = static_cast<unsigned char>(std::clamp(16.0 - std::sqrt(x * x + y * y + z * z), 0.0, 1.0) * 255);
    }
    auto grid = sized<vr_grid_info>();
    grid.dims[0] = grid.dims[1] = grid.dims[2] = side;
    grid.sample_type = VR_SAMPLE_U8;
    grid.samples = samples.data();
    grid.sample_bytes = samples.size();
    const vr_knot knots[] = {{0.0, {0.9, 0.5, 0.2}, 0.0}, {255.0, {0.9, 0.5, 0.2}, 0.1}};
    vr_scene *scene = nullptr;
    check(vr_scene_create_grid(gpu, &grid, knots, 2, &scene), "vr_scene_create_grid");
    return Scene(scene);
}

void run(int argc, char **argv) {
    if (argc < 3) throw std::runtime_error("usage: draw FILE|- OUT.ppm [TECHNIQUE]");
    const std::string file = argv[1];
    const unsigned width = 320, height = 240;
    const Gpu gpu = open();
    const Scene scene = file == "-" ? ball(gpu.get()) : load(gpu.get(), file);
    auto view = sized<vr_view>();
    check(vr_scene_view(scene.get(), width, height, &view), "vr_scene_view");
    std::vector<float> pixels(4u * width * height);
    check(vr_render(scene.get(), argc > 3 ? argv[3] : nullptr, &view, pixels.data(), pixels.size()), "vr_render");

    std::FILE *out = std::fopen(argv[2], "wb");
    if (!out) throw std::runtime_error(std::string(argv[2]) + ": cannot be written");
    std::fprintf(out, "P6\n%u %u\n255\n", width, height);
    double opacity = 0;
    for (std::size_t i = 0; i < pixels.size(); i += 4) {
        opacity += pixels[i + 3];
        for (std::size_t c = i; c < i + 3; ++c) {
            std::fputc(static_cast<int>(255 * std::pow(std::clamp(pixels[c], 0.0f, 1.0f), 1 / 2.2f) + 0.5f), out);
        }
    }
    if (std::fclose(out)) throw std::runtime_error(std::string(argv[2]) + ": cannot be written");
    std::printf("%s: mean opacity %.4f\n", vr_gpu_name(gpu.get()), opacity / (width * height));
}

} // namespace

int main(int argc, char **argv) {
    try {
        run(argc, argv);
        return 0;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
