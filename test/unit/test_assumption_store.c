// SPDX-License-Identifier: MIT
// Assumption store: every sequence of operations is compared with a model of the state diagram.
#include <string.h>

#include "iwheel/private/assumption_store.h"
#include "unit.h"

#define POISON 0xA5

static iw_assumption_store_t assumptions;

void setUp(void) {
    memset(&assumptions, POISON, sizeof assumptions);
    iw_assumption_init(&assumptions);
}

static void assert_entry(iw_assumption_item_t item, iw_assumption_state_t state, iw_source_t source, int32_t figure) {
    const iw_assumption_entry_t *entry = &assumptions.entry[item];
    TEST_ASSERT_EQUAL_INT(state, entry->state);
    TEST_ASSERT_EQUAL_INT(source, entry->source);
    TEST_ASSERT_EQUAL_INT32(figure, entry->figure);
}

TEST(test_assumption_init_sets_assumed_and_the_document_source) {
    static const iw_source_t origin[IW_ASSUMPTION_ITEMS] = {
        [IW_ASSUMPTION_FORCE_UNIT_LEFT] = IW_SOURCE_DOCUMENT,
        [IW_ASSUMPTION_FORCE_UNIT_RIGHT] = IW_SOURCE_DOCUMENT,
        [IW_ASSUMPTION_OFFSET_INCLUDED] = IW_SOURCE_DOCUMENT,
        [IW_ASSUMPTION_WHEEL_RADIUS] = IW_SOURCE_DOCUMENT,
    };
    for (int item = 0; item < IW_ASSUMPTION_DLC; item++) {
        assert_entry((iw_assumption_item_t)item, IW_ASSUMED, origin[item], 0);
    }
    // The table of the document shows the lengths, but no sentence states them: both sources are correct.
    TEST_ASSERT_EQUAL_INT(IW_ASSUMED, assumptions.entry[IW_ASSUMPTION_DLC].state);
    TEST_ASSERT_EQUAL_INT32(0, assumptions.entry[IW_ASSUMPTION_DLC].figure);
    TEST_ASSERT_EQUAL_UINT32(0, assumptions.changes);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMPTION_ITEMS, assumptions.doubt);
}

TEST(test_assumption_items_are_fourteen) {
    TEST_ASSERT_EQUAL_INT(14, IW_ASSUMPTION_ITEMS);
}

TEST(test_assume_sets_the_source) {
    iw_assumption_assume(&assumptions, IW_ASSUMPTION_SETPOINT_TYPE, IW_SOURCE_CONFIGURATION);
    assert_entry(IW_ASSUMPTION_SETPOINT_TYPE, IW_ASSUMED, IW_SOURCE_CONFIGURATION, 0);
    TEST_ASSERT_EQUAL_UINT32(1, assumptions.changes);
    iw_assumption_assume(&assumptions, IW_ASSUMPTION_SETPOINT_TYPE, IW_SOURCE_CONFIGURATION);
    TEST_ASSERT_EQUAL_UINT32(1, assumptions.changes);
    iw_assumption_assume(&assumptions, IW_ASSUMPTION_SETPOINT_TYPE, IW_SOURCE_NONE);
    assert_entry(IW_ASSUMPTION_SETPOINT_TYPE, IW_ASSUMED, IW_SOURCE_NONE, 0);
}

TEST(test_confirm_by_bus_does_not_lift_a_contradiction) {
    iw_assumption_contradict(&assumptions, IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_SOURCE_BUS, 1010);
    iw_assumption_confirm(&assumptions, IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_SOURCE_BUS, 9980);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_CONTRADICTED, IW_SOURCE_BUS, 1010);
    TEST_ASSERT_EQUAL_UINT32(1, assumptions.changes);
}

TEST(test_confirm_by_operator_lifts_a_contradiction) {
    iw_assumption_contradict(&assumptions, IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_SOURCE_BUS, 1010);
    iw_assumption_confirm(&assumptions, IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_SOURCE_OPERATOR, 0);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_CONFIRMED, IW_SOURCE_OPERATOR, 0);
    TEST_ASSERT_EQUAL_UINT32(2, assumptions.changes);
}

TEST(test_confirm_by_bus_does_not_replace_the_operator) {
    iw_assumption_confirm(&assumptions, IW_ASSUMPTION_WHEEL_RADIUS, IW_SOURCE_OPERATOR, 0);
    iw_assumption_confirm(&assumptions, IW_ASSUMPTION_WHEEL_RADIUS, IW_SOURCE_BUS, 77);
    assert_entry(IW_ASSUMPTION_WHEEL_RADIUS, IW_CONFIRMED, IW_SOURCE_OPERATOR, 0);
    TEST_ASSERT_EQUAL_UINT32(1, assumptions.changes);
}

TEST(test_confirm_by_operator_replaces_the_bus) {
    iw_assumption_confirm(&assumptions, IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, IW_SOURCE_BUS, 120);
    assert_entry(IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, IW_CONFIRMED, IW_SOURCE_BUS, 120);
    iw_assumption_confirm(&assumptions, IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, IW_SOURCE_OPERATOR, 0);
    assert_entry(IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, IW_CONFIRMED, IW_SOURCE_OPERATOR, 0);
}

TEST(test_contradict_by_bus_replaces_confirmation_by_operator) {
    iw_assumption_confirm(&assumptions, IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT, IW_SOURCE_OPERATOR, 0);
    iw_assumption_contradict(&assumptions, IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT, IW_SOURCE_BUS, -120);
    assert_entry(IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT, IW_CONTRADICTED, IW_SOURCE_BUS, -120);
}

TEST(test_assumption_figure_stores_int32_extremes) {
    iw_assumption_contradict(&assumptions, IW_ASSUMPTION_DLC, IW_SOURCE_BUS, INT32_MIN);
    assert_entry(IW_ASSUMPTION_DLC, IW_CONTRADICTED, IW_SOURCE_BUS, INT32_MIN);
    iw_assumption_confirm(&assumptions, IW_ASSUMPTION_DLC, IW_SOURCE_OPERATOR, INT32_MAX);
    assert_entry(IW_ASSUMPTION_DLC, IW_CONFIRMED, IW_SOURCE_OPERATOR, INT32_MAX);
}

TEST(test_contradict_changes_no_other_item) {
    for (int touched = 0; touched < IW_ASSUMPTION_ITEMS; touched++) {
        setUp();
        const iw_assumption_store_t before = assumptions;
        iw_assumption_contradict(&assumptions, (iw_assumption_item_t)touched, IW_SOURCE_BUS, 5);
        for (int item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
            const iw_assumption_entry_t *was = &before.entry[item];
            if (item != touched) {
                assert_entry((iw_assumption_item_t)item, was->state, was->source, was->figure);
            }
        }
        assert_entry((iw_assumption_item_t)touched, IW_CONTRADICTED, IW_SOURCE_BUS, 5);
    }
}

/// Operations of the walk: assume with two sources, confirm and contradict by the bus and by the operator.
typedef enum {
    ASSUME_DOCUMENT,
    ASSUME_CONFIGURATION,
    CONFIRM_BUS,
    CONFIRM_OPERATOR,
    CONTRADICT_BUS,
    CONTRADICT_OPERATOR,
    OPERATIONS
} operation_t;

/// Returns the entry that the state diagram and the header of `confirm` require after the operation.
static iw_assumption_entry_t model(iw_assumption_entry_t entry, operation_t operation, int32_t figure) {
    const bool assumed = entry.state == IW_ASSUMED;
    const bool open_to_bus = assumed || (entry.state == IW_CONFIRMED && entry.source != IW_SOURCE_OPERATOR);
    const iw_assumption_entry_t results[OPERATIONS] = {
        [ASSUME_DOCUMENT] = {IW_ASSUMED, IW_SOURCE_DOCUMENT, 0},
        [ASSUME_CONFIGURATION] = {IW_ASSUMED, IW_SOURCE_CONFIGURATION, 0},
        [CONFIRM_BUS] = {IW_CONFIRMED, IW_SOURCE_BUS, figure},
        [CONFIRM_OPERATOR] = {IW_CONFIRMED, IW_SOURCE_OPERATOR, figure},
        [CONTRADICT_BUS] = {IW_CONTRADICTED, IW_SOURCE_BUS, figure},
        [CONTRADICT_OPERATOR] = {IW_CONTRADICTED, IW_SOURCE_OPERATOR, figure},
    };
    const bool ignored = (operation <= ASSUME_CONFIGURATION && !assumed) || (operation == CONFIRM_BUS && !open_to_bus);
    return ignored ? entry : results[operation];
}

static void apply(operation_t operation, int32_t figure) {
    const iw_assumption_item_t item = IW_ASSUMPTION_GEAR_RATIO;
    if (operation <= ASSUME_CONFIGURATION) {
        iw_assumption_assume(&assumptions, item,
                             (operation == ASSUME_DOCUMENT) ? IW_SOURCE_DOCUMENT : IW_SOURCE_CONFIGURATION);
    } else if (operation <= CONFIRM_OPERATOR) {
        iw_assumption_confirm(&assumptions, item, (operation == CONFIRM_BUS) ? IW_SOURCE_BUS : IW_SOURCE_OPERATOR,
                              figure);
    } else {
        iw_assumption_contradict(&assumptions, item, (operation == CONTRADICT_BUS) ? IW_SOURCE_BUS : IW_SOURCE_OPERATOR,
                                 figure);
    }
}

static bool differs(const iw_assumption_entry_t *a, const iw_assumption_entry_t *b) {
    return a->state != b->state || a->source != b->source || a->figure != b->figure;
}

static void walk(uint32_t path, unsigned length) {
    iw_assumption_entry_t expected = {IW_ASSUMED, IW_SOURCE_NONE, 0};
    setUp();
    for (unsigned i = 0; i < length; i++, path /= OPERATIONS) {
        const uint32_t changes = assumptions.changes;
        const operation_t operation = (operation_t)(path % OPERATIONS);
        const int32_t figure = (int32_t)(i % 3);
        const iw_assumption_entry_t before = expected;
        expected = model(expected, operation, figure);
        apply(operation, figure);
        if (differs(&expected, &assumptions.entry[IW_ASSUMPTION_GEAR_RATIO])) {
            assert_entry(IW_ASSUMPTION_GEAR_RATIO, expected.state, expected.source, expected.figure);
        }
        if ((assumptions.changes > changes) != differs(&before, &expected)) {
            TEST_FAIL_MESSAGE("changes must grow with every change and with nothing else");
        }
    }
}

TEST(test_assumption_every_six_operations_follow_the_diagram) {
    for (uint32_t path = 0; path < 46656; path++) {
        walk(path, 6);
    }
}
