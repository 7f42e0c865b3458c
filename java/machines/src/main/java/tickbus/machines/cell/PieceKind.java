package tickbus.machines.cell;

/** The kinds of cylinders, with their codes in a pallet's record. */
public enum PieceKind {
    /** Not decided yet. */
    UNDEFINED(0x00, null, false),
    /** Black. */
    BLACK(0x10, Colour.BLACK, false),
    /** Black with a cap. */
    BLACK_CAPPED(0x20, Colour.BLACK, true),
    /** Red. */
    RED(0x30, Colour.RED, false),
    /** Red with a cap. */
    RED_CAPPED(0x40, Colour.RED, true),
    /** Metallic. */
    METALLIC(0x50, Colour.METALLIC, false),
    /** Metallic with a cap. */
    METALLIC_CAPPED(0x60, Colour.METALLIC, true);

    private final int code;
    private final Colour colour;
    private final boolean capped;

    PieceKind(int code, Colour colour, boolean capped) {
        this.code = code;
        this.colour = colour;
        this.capped = capped;
    }

    /** The kind's code in the record, 0x00 to 0x60. */
    public int code() {
        return code;
    }

    /** The material of the kind's sleeve; null for {@link #UNDEFINED}. */
    public Colour colour() {
        return colour;
    }

    /** True if the kind has a cap. */
    public boolean isCapped() {
        return capped;
    }

    /** The kind with this code; {@link #UNDEFINED} for an unknown one. */
    public static PieceKind of(int code) {
        for (PieceKind kind : values()) {
            if (kind.code == code) {
                return kind;
            }
        }
        return UNDEFINED;
    }

    /** The current kind of a piece. */
    public static PieceKind of(Workpiece piece) {
        return values()[1 + 2 * piece.colour().ordinal() + (piece.has(Part.CAP) ? 1 : 0)];
    }
}
