// The edge-avoiding filter and its gradient, for XLA on CPUs. The definition is `plain_filter` of `kernels.py`.
//
// Images are independent and shared out over threads. Rows are padded by the dilation with the nearest pixel's values, so
// that every loop over a row is one over consecutive floats.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <thread>
#include <vector>

#include "xla/ffi/api/ffi.h"

namespace ffi = xla::ffi;
using Values = ffi::Buffer<ffi::F32>;
using Result = ffi::ResultBuffer<ffi::F32>;
using Dilations = ffi::Span<const int64_t>;

namespace {

constexpr float kLogLimit = 20;
constexpr float kApart = 0.99f;
constexpr float kFar = 100;

struct Shape {
  int64_t images, predicted, values, height, width, features;

  Shape(const Values& of_predicted, const Values& of_values, int64_t features)
      : images(of_predicted.dimensions()[0]), predicted(of_predicted.dimensions()[1]),
        values(of_values.dimensions()[1]), height(of_values.dimensions()[2]), width(of_values.dimensions()[3]),
        features(features) {}

  int64_t area() const { return height * width; }
};

// Planes of one image with margins.
struct Padded {
  int64_t planes, height, width, margin, stride, rows;
  std::vector<float> data;

  Padded(int64_t planes, const Shape& shape, int64_t margin)
      : planes(planes), height(shape.height), width(shape.width), margin(margin), stride(width + 2 * margin),
        rows(height + 2 * margin), data(planes * stride * rows, 0.0f) {}

  // With the values of `source`, [planes, height, width].
  Padded(int64_t planes, const Shape& shape, int64_t margin, const float* source) : Padded(planes, shape, margin) {
    for (int64_t plane = 0; plane < planes; ++plane) {
      for (int64_t y = -margin; y < height + margin; ++y) {
        const float* row = source + (plane * height + std::clamp<int64_t>(y, 0, height - 1)) * width;
        float* out = at(plane, y);
        std::copy(row, row + width, out);
        std::fill(out - margin, out, row[0]);
        std::fill(out + width, out + width + margin, row[width - 1]);
      }
    }
  }

  // The pixel (0, y) of a plane; y and offsets from it may lie in the margins.
  float* at(int64_t plane, int64_t y) { return data.data() + (plane * rows + y + margin) * stride + margin; }

  // Writes to [planes, height, width] the sums over all pixels, of margins too, that show the same source.
  void fold(float* target) {
    std::fill(target, target + planes * height * width, 0.0f);
    for (int64_t plane = 0; plane < planes; ++plane) {
      for (int64_t y = -margin; y < height + margin; ++y) {
        float* out = target + (plane * height + std::clamp<int64_t>(y, 0, height - 1)) * width;
        const float* row = at(plane, y);
        for (int64_t x = 0; x < width; ++x) out[x] += row[x];
        for (int64_t x = 1; x <= margin; ++x) {
          out[0] += row[-x];
          out[width - 1] += row[width - 1 + x];
        }
      }
    }
  }
};

float bounded(float log) { return std::clamp(log, -kLogLimit, kLogLimit); }

// Calls `work` with each image's number, on all cores.
template <typename Work>
void for_each_image(int64_t images, Work work) {
  const int64_t count = std::min<int64_t>(images, std::max(1u, std::thread::hardware_concurrency()));
  std::vector<std::thread> threads;
  for (int64_t t = 0; t < count; ++t) {
    threads.emplace_back([=] { for (int64_t i = t; i < images; i += count) work(i); });
  }
  for (auto& thread : threads) thread.join();
}

// One level of one image: its kernels, and the values that they filter.
struct Level {
  const Shape& shape;
  int64_t dilation;
  const float* own;
  Padded predicted, hit, values;
  std::vector<float> weights, own_weight, norm;

  // `of_level` are the predicted planes: features, logarithms of the weight as a neighbour and of the own weight.
  Level(const Shape& s, int64_t dilation, const float* of_level, const float* h, const float* v)
      : shape(s), dilation(dilation), own(of_level + (s.features + 1) * s.area()),
        predicted(s.features + 1, s, dilation, of_level), hit(1, s, dilation, h), values(s.values, s, dilation, v),
        weights(8 * s.width), own_weight(s.width), norm(s.width) {}

  // Row and column offset of a neighbour.
  int64_t dy(int k) const { return ((k + (k >= 4)) / 3 - 1) * dilation; }
  int64_t dx(int k) const { return ((k + (k >= 4)) % 3 - 1) * dilation; }

  // Computes the weights of a row's pixels and of their neighbours, and their sums.
  void weigh(int64_t y) {
    const int64_t width = shape.width;
    for (int64_t x = 0; x < width; ++x) norm[x] = own_weight[x] = std::exp(bounded(own[y * width + x]));
    for (int k = 0; k < 8; ++k) {
      float* weight = weights.data() + k * width;
      const float* log_weight = predicted.at(shape.features, y + dy(k)) + dx(k);
      const float *other_hit = hit.at(0, y + dy(k)) + dx(k), *own_hit = hit.at(0, y);
      for (int64_t x = 0; x < width; ++x) {
        weight[x] = bounded(log_weight[x]) - (std::fabs(other_hit[x] - own_hit[x]) > kApart ? kFar : 0.0f);
      }
      for (int64_t f = 0; f < shape.features; ++f) {
        const float *other = predicted.at(f, y + dy(k)) + dx(k), *here = predicted.at(f, y);
        for (int64_t x = 0; x < width; ++x) weight[x] -= (other[x] - here[x]) * (other[x] - here[x]);
      }
      for (int64_t x = 0; x < width; ++x) {
        weight[x] = std::exp(std::max(weight[x], -80.0f));
        norm[x] += weight[x];
      }
    }
  }

  // Writes the filtered values, [values, height, width].
  void filter(float* filtered) {
    const int64_t width = shape.width;
    for (int64_t y = 0; y < shape.height; ++y) {
      weigh(y);
      for (int64_t c = 0; c < shape.values; ++c) {
        float* result = filtered + (c * shape.height + y) * width;
        const float* here = values.at(c, y);
        for (int64_t x = 0; x < width; ++x) result[x] = own_weight[x] * here[x];
        for (int k = 0; k < 8; ++k) {
          const float *other = values.at(c, y + dy(k)) + dx(k), *weight = weights.data() + k * width;
          for (int64_t x = 0; x < width; ++x) result[x] += weight[x] * other[x];
        }
        for (int64_t x = 0; x < width; ++x) result[x] /= norm[x];
      }
    }
  }

  // From the gradient by the filtered values writes that by the predicted planes, and over `gradient` that by the values.
  void differentiate(const float* filtered, float* gradient, float* of_level) {
    const int64_t width = shape.width, area = shape.area();
    Padded d_predicted(shape.features + 1, shape, dilation), d_values(shape.values, shape, dilation);
    std::vector<float> scaled(shape.values * width), log_gradient(width);
    for (int64_t y = 0; y < shape.height; ++y) {
      weigh(y);
      float* d_own = of_level + (shape.features + 1) * area + y * width;
      std::fill(d_own, d_own + width, 0.0f);
      for (int64_t c = 0; c < shape.values; ++c) {
        const float *of_filtered = gradient + c * area + y * width, *result = filtered + c * area + y * width;
        const float* here = values.at(c, y);
        float *s = scaled.data() + c * width, *d_here = d_values.at(c, y);
        for (int64_t x = 0; x < width; ++x) {
          s[x] = of_filtered[x] / norm[x];
          d_own[x] += s[x] * (here[x] - result[x]);
          d_here[x] += s[x] * own_weight[x];
        }
      }
      for (int64_t x = 0; x < width; ++x) d_own[x] *= std::fabs(own[y * width + x]) < kLogLimit ? own_weight[x] : 0.0f;
      for (int k = 0; k < 8; ++k) {
        const float* weight = weights.data() + k * width;
        float* d_log = log_gradient.data();
        std::fill(d_log, d_log + width, 0.0f);
        for (int64_t c = 0; c < shape.values; ++c) {
          const float *s = scaled.data() + c * width, *result = filtered + c * area + y * width;
          const float* other = values.at(c, y + dy(k)) + dx(k);
          float* d_other = d_values.at(c, y + dy(k)) + dx(k);
          for (int64_t x = 0; x < width; ++x) d_log[x] += s[x] * (other[x] - result[x]);
          for (int64_t x = 0; x < width; ++x) d_other[x] += s[x] * weight[x];
        }
        const float* log_weight = predicted.at(shape.features, y + dy(k)) + dx(k);
        float* d_log_weight = d_predicted.at(shape.features, y + dy(k)) + dx(k);
        for (int64_t x = 0; x < width; ++x) {
          d_log[x] *= weight[x];
          d_log_weight[x] += std::fabs(log_weight[x]) < kLogLimit ? d_log[x] : 0.0f;
        }
        for (int64_t f = 0; f < shape.features; ++f) {
          const float *other = predicted.at(f, y + dy(k)) + dx(k), *here = predicted.at(f, y);
          float *d_other = d_predicted.at(f, y + dy(k)) + dx(k), *d_here = d_predicted.at(f, y);
          for (int64_t x = 0; x < width; ++x) d_other[x] -= 2 * (other[x] - here[x]) * d_log[x];
          for (int64_t x = 0; x < width; ++x) d_here[x] += 2 * (other[x] - here[x]) * d_log[x];
        }
      }
    }
    d_predicted.fold(of_level);
    d_values.fold(gradient);
  }
};

// The values before each level and after the last, [levels + 1, values, height, width].
std::vector<float> filter_image(const Shape& shape, Dilations dilations, const float* predicted, const float* hit,
                                const float* values) {
  const int64_t size = shape.values * shape.area();
  std::vector<float> all((dilations.size() + 1) * size);
  std::copy(values, values + size, all.data());
  for (size_t l = 0; l < dilations.size(); ++l) {
    float* before = all.data() + l * size;
    Level(shape, dilations[l], predicted + l * (shape.features + 2) * shape.area(), hit, before).filter(before + size);
  }
  return all;
}

ffi::Error Filter(int64_t features, Dilations dilations, Values predicted, Values hit, Values values, Result filtered) {
  const Shape shape(predicted, values, features);
  const int64_t size = shape.values * shape.area();
  for_each_image(shape.images, [&](int64_t image) {
    const auto all = filter_image(shape, dilations, predicted.typed_data() + image * shape.predicted * shape.area(),
                                  hit.typed_data() + image * shape.area(), values.typed_data() + image * size);
    std::copy(all.end() - size, all.end(), filtered->typed_data() + image * size);
  });
  return ffi::Error::Success();
}

ffi::Error Gradient(int64_t features, Dilations dilations, Values predicted, Values hit, Values values,
                    Values of_filtered, Result of_predicted) {
  const Shape shape(predicted, values, features);
  const int64_t size = shape.values * shape.area(), of_level = (features + 2) * shape.area();
  for_each_image(shape.images, [&](int64_t image) {
    const int64_t start = image * shape.predicted * shape.area();
    const float *kernels = predicted.typed_data() + start, *hits = hit.typed_data() + image * shape.area();
    const auto all = filter_image(shape, dilations, kernels, hits, values.typed_data() + image * size);
    const float* source = of_filtered.typed_data() + image * size;
    std::vector<float> gradient(source, source + size);
    float* out = of_predicted->typed_data() + start;
    std::fill(out, out + shape.predicted * shape.area(), 0.0f);
    for (size_t l = dilations.size(); l-- > 0;) {
      const float* before = all.data() + l * size;
      Level(shape, dilations[l], kernels + l * of_level, hits, before)
          .differentiate(before + size, gradient.data(), out + l * of_level);
    }
  });
  return ffi::Error::Success();
}

}  // namespace

XLA_FFI_DEFINE_HANDLER_SYMBOL(
    FilterImages, Filter,
    ffi::Ffi::Bind().Attr<int64_t>("features").Attr<Dilations>("dilations").Arg<Values>().Arg<Values>().Arg<Values>()
        .Ret<Values>());
XLA_FFI_DEFINE_HANDLER_SYMBOL(
    FilterImagesGradient, Gradient,
    ffi::Ffi::Bind().Attr<int64_t>("features").Attr<Dilations>("dilations").Arg<Values>().Arg<Values>().Arg<Values>()
        .Arg<Values>().Ret<Values>());
