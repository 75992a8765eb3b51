// Shapes without a closed form, which are evaluated at all points of a query at once.
#pragma once

#include <cstdint>
#include <memory>

#include "isa/isa.hpp"

namespace surfsup {

// A shape in its own frame.
class SampledShape {
public:
    virtual ~SampledShape() = default;

    // Number of floats that `sample` needs as scratch memory.
    virtual int64_t scratch_size(const Isa&) const { return 0; }

    // Writes signed distances and normals of points (count, 3). `indices` has room for `count`. Points that it cannot decide
    // get a distance of NaN.
    virtual void sample(const Isa&, const float* points, int32_t count, const Samples&, int32_t* indices,
                        float* scratch) const = 0;

    // Writes distance (count) and normal (count, 3) of points that `sample` could not decide. Runs in the calling thread.
    virtual void sample_undecided(const float* points, int32_t count, float* distance, float* normal) const = 0;
};

class NeuralShape : public SampledShape {
public:
    // The memory that `field` refers to must live as long as the pointer.
    explicit NeuralShape(std::shared_ptr<const NeuralField> field) : field_(std::move(field)) {}

    int64_t scratch_size(const Isa& isa) const override { return isa.sdf->field_scratch_size(*field_); }
    void sample(const Isa& isa, const float* points, int32_t count, const Samples& samples, int32_t* indices,
                float* scratch) const override {
        isa.sdf->sample_field(*field_, points, count, samples, indices, scratch);
    }
    void sample_undecided(const float*, int32_t, float*, float*) const override {}  // only points that are NaN

private:
    std::shared_ptr<const NeuralField> field_;
};

}  // namespace surfsup
