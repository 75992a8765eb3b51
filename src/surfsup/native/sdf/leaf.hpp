// What a solid is made of that is looked at from many points at once.
#pragma once

#include <cstdint>
#include <memory>

#include "isa/isa.hpp"

namespace surfsup {

// A solid without parts in its own frame.
class Leaf {
public:
    virtual ~Leaf() = default;

    // Floats that `look` needs.
    virtual int64_t scratch(const Isa&) const { return 0; }

    // Distance and unit normal of points (count, 3); `list` has room for as many. It may leave a point without a number.
    virtual void look(const Isa&, const float* points, int32_t count, const LeafLook&, int32_t* list, float* scratch) const = 0;

    // The same of those points that were left, by the calling thread alone.
    virtual void look_at_rest(const float* points, int32_t count, float* distance, float* normal) const = 0;
};

// One that a network knows.
class FieldLeaf : public Leaf {
public:
    // What the field points to lives as long as the pointer is held.
    explicit FieldLeaf(std::shared_ptr<const Field> field) : field_(std::move(field)) {}

    int64_t scratch(const Isa& isa) const override { return isa.field_scratch(*field_); }
    void look(const Isa& isa, const float* points, int32_t count, const LeafLook& to, int32_t* list, float* scratch) const override {
        isa.ask_field(*field_, points, count, to, list, scratch);
    }
    void look_at_rest(const float*, int32_t, float*, float*) const override {}  // their places are no numbers

private:
    std::shared_ptr<const Field> field_;
};

}  // namespace surfsup
