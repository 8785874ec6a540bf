// What comes from outside: the centers of an NPY file, and what the system says about this process.
#pragma once

#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

// A center and a radius, as Embree wants them.
struct Sphere {
    float x, y, z, radius;
};

// Reads float32 centers in C order from an NPY file of version 1.
inline std::vector<Sphere> spheres_of(const std::string &path, float radius) {
    const auto fail = [&](const char *why) { throw std::runtime_error(path + ": " + why); };
    std::ifstream file(path, std::ios::binary);
    char front[10] = {};
    file.read(front, sizeof front);
    if (!file || std::memcmp(front, "\x93NUMPY\x01", 7) != 0) fail("wanted an NPY file of version 1");
    std::string header(static_cast<unsigned char>(front[8]) + 256 * static_cast<unsigned char>(front[9]), ' ');
    file.read(header.data(), header.size());
    const size_t shape = header.find('(');
    const bool is_understood = header.find("'<f4'") != std::string::npos &&
                               header.find("False") != std::string::npos && shape != std::string::npos &&
                               header.find(", 3)") != std::string::npos;
    if (!is_understood) fail("wanted float32 of shape (N, 3) in C order");
    const size_t count = std::stoull(header.substr(shape + 1));

    std::vector<Sphere> spheres(count);
    std::vector<float> centers(3 << 16);
    for (size_t done = 0; done < count;) {
        const size_t now = std::min<size_t>(count - done, 1 << 16);
        file.read(reinterpret_cast<char *>(centers.data()), 3 * sizeof(float) * now);
        if (!file) fail("the file is shorter than its header says");
        for (size_t k = 0; k < now; k++)
            spheres[done + k] = {centers[3 * k], centers[3 * k + 1], centers[3 * k + 2], radius};
        done += now;
    }
    return spheres;
}

// Bytes of a line of /proc/self/status, "VmRSS:" or "VmHWM:"; 0 where there is none.
inline double memory_bytes(const std::string &key) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.rfind(key, 0) == 0) return 1024 * std::stod(line.substr(key.size()));
    return 0;
}
