// What a picture starts with: vectors, random numbers, and the rays of the two cameras of `tyndall bench`.
#pragma once

#include <cmath>
#include <cstdint>

struct Vector {
    float x, y, z;
};

inline Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vector operator*(float scale, Vector a) { return {scale * a.x, scale * a.y, scale * a.z}; }
inline float dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vector normalized(Vector a) { return (1 / std::sqrt(dot(a, a))) * a; }
inline Vector cross(Vector a, Vector b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// A sequence of random numbers; source: Steele, Lea and Flood 2014, SplitMix64.
class Random {
public:
    explicit Random(uint64_t seed) : state_(seed * 0xd1342543de82ef95u) {}

    // Uniform in [0, 1).
    float unit() {
        uint64_t bits = state_ += 0x9e3779b97f4a7c15u;
        bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9u;
        bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebu;
        return static_cast<float>((bits ^ (bits >> 31)) >> 40) * 0x1p-24f;
    }

    // Uniform on the unit sphere.
    Vector direction() {
        const float height = 2 * unit() - 1, angle = 6.2831853f * unit();
        const float ring = std::sqrt(1 - height * height);
        return {ring * std::cos(angle), ring * std::sin(angle), height};
    }

    // By the cosine to `normal`: the sum of two unit vectors, one of them uniform, points so.
    Vector around(Vector normal) {
        const Vector sum = normal + direction();
        return dot(sum, sum) > 1e-8f ? normalized(sum) : normal;
    }

private:
    uint64_t state_;
};

struct Line {
    Vector origin, direction;
};

enum class Projection { kOrthographic, kPerspective };

// The unit cube from an oblique direction, z up: 1.8 high, or 30 degrees from a distance of 3.5.
class View {
public:
    View(Projection projection, int edge) : orthographic_(projection == Projection::kOrthographic) {
        const Vector toward_eye = normalized({0.80f, 0.55f, 0.45f});
        eye_ = Vector{0.5f, 0.5f, 0.5f} + 3.5f * toward_eye;
        forward_ = -1.0f * toward_eye;
        const float half_height = orthographic_ ? 0.9f : std::tan(0.2617994f);
        const Vector right = normalized(cross(forward_, {0, 0, 1}));
        const Vector down = cross(forward_, right);
        across_ = (2 * half_height / edge) * right;
        down_ = (2 * half_height / edge) * down;
        corner_ = -half_height * (right + down);
    }

    // The ray through a point of the picture, in pixels from its upper left corner.
    Line through(float across, float down) const {
        const Vector point = corner_ + across * across_ + down * down_;
        if (orthographic_) return {eye_ + point, forward_};
        return {eye_, normalized(forward_ + point)};
    }

private:
    bool orthographic_;
    Vector eye_, forward_, across_, down_, corner_;
};
