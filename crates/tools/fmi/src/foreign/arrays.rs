//! Arrays of FMI 3.0: each element becomes a variable, such as `y[1]` or `A[2,3]`.
//!
//! Indices begin at 1, as in the naming convention "structured" of the standard. Calls pass the elements in row-major
//! order: the last index changes first (FMI 3.0, section 2.2.6).

use super::model::{Array, Declared, Dimension, Element, ForeignVariable, Model};

/// The most elements of all arrays of a model that become variables. A larger array stays one variable, which cannot be
/// a signal.
const MOST: usize = 100_000;

impl Array {
    /// A sentence with the names of the elements.
    pub(super) fn told(&self) -> String {
        let first = vec![1; self.shape.len()];
        format!(
            "it has the elements \"{}\" to \"{}\"",
            named(&self.name, &first),
            named(&self.name, &self.shape)
        )
    }
}

/// The name of an element.
fn named(array: &str, indices: &[u64]) -> String {
    let indices: Vec<String> = indices.iter().map(u64::to_string).collect();
    format!("{array}[{}]", indices.join(","))
}

impl Model {
    /// Returns the array with this name, or of which this is the name of an element, existing or not.
    pub(super) fn array_of(&self, name: &str) -> Option<&Array> {
        let array = name.rsplit_once('[').map_or(name, |(array, _)| array);
        let mut arrays = self.arrays.iter();
        arrays.find(|one| one.name == name || one.name == array)
    }

    /// Makes the variables anew, with values of structural parameters, by their value references, in place of their
    /// start values.
    pub(super) fn resize(&mut self, sizes: &[(u32, u64)]) {
        let size = |dimension: &Dimension| match *dimension {
            Dimension::Fixed(size) => Some(size),
            Dimension::Structural(reference) => {
                let mut set = sizes.iter();
                let set = set.find(|(one, _)| *one == reference);
                let declared = || {
                    let mut all = self.declared.iter();
                    all.find(|one| one.variable.reference == reference)?.size
                };
                set.map(|(_, size)| *size).or_else(declared)
            }
        };
        let mut left = MOST;
        let (mut variables, mut arrays) = (Vec::new(), Vec::new());
        for Declared {
            variable,
            dimensions,
            ..
        } in &self.declared
        {
            if dimensions.is_empty() {
                variables.push(variable.clone());
                continue;
            }
            let shape: Option<Vec<u64>> = dimensions.iter().map(size).collect();
            let count = shape.as_ref().and_then(|shape| {
                let mut sizes = shape.iter();
                let product = sizes.try_fold(1_u64, |product, size| product.checked_mul(*size));
                usize::try_from(product?).ok()
            });
            let (Some(shape), Some(count)) = (shape, count.filter(|count| *count <= left)) else {
                variables.push(ForeignVariable {
                    value_type: None,
                    type_name: format!("array of {}", variable.type_name),
                    ..variable.clone()
                });
                continue;
            };
            left -= count;
            let mut indices = vec![1; shape.len()];
            let first = variables.len();
            for at in 0..count {
                variables.push(ForeignVariable {
                    name: named(&variable.name, &indices),
                    aliases: (variable.aliases.iter())
                        .map(|alias| named(alias, &indices))
                        .collect(),
                    element: Some(Element { at, of: count }),
                    ..variable.clone()
                });
                for (index, size) in indices.iter_mut().zip(&shape).rev() {
                    *index += 1;
                    if *index <= *size {
                        break;
                    }
                    *index = 1;
                }
            }
            let names = std::iter::once(&variable.name).chain(&variable.aliases);
            arrays.extend(names.map(|name| Array {
                name: name.clone(),
                type_name: variable.type_name.clone(),
                first,
                count,
                shape: shape.clone(),
            }));
        }
        self.variables = variables;
        self.arrays = arrays;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(variables: &str) -> Model {
        let text = format!(
            "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"x\" instantiationToken=\"g\">\
             <CoSimulation modelIdentifier=\"x\"/><ModelVariables>{variables}</ModelVariables></fmiModelDescription>"
        );
        Model::parse("m.xml", &text).unwrap_or_else(|mistakes| panic!("{mistakes}"))
    }

    fn names(model: &Model) -> Vec<&str> {
        model.variables.iter().map(|one| &*one.name).collect()
    }

    #[test]
    fn elements_are_in_row_major_order() {
        let model = model(
            "<Float64 name=\"A\" valueReference=\"1\" causality=\"output\"><Dimension start=\"2\"/>\
             <Dimension start=\"3\"/><Alias name=\"B\"/></Float64><Boolean name=\"x\" valueReference=\"2\"/>",
        );
        assert_eq!(
            names(&model),
            [
                "A[1,1]", "A[1,2]", "A[1,3]", "A[2,1]", "A[2,2]", "A[2,3]", "x"
            ]
        );
        assert_eq!(model.position("B[2,1]"), Some(3));
        assert_eq!(
            model.variables[3].element,
            Some(Element { at: 3, of: 6 }),
            "the fourth of six"
        );
        let array = model.array_of("A[9,9]").expect("an array");
        assert_eq!(array.told(), "it has the elements \"A[1,1]\" to \"A[2,3]\"");
        assert_eq!(model.array_of("B").map(|array| array.count), Some(6));
        assert_eq!(model.array_of("x[1]"), None);
    }

    #[test]
    fn structural_parameters_are_sizes() {
        let mut model = model(
            "<UInt64 name=\"n\" valueReference=\"7\" causality=\"structuralParameter\" start=\"2\"/>\
             <Float64 name=\"y\" valueReference=\"1\"><Dimension valueReference=\"7\"/></Float64>\
             <Float64 name=\"z\" valueReference=\"2\"><Dimension valueReference=\"8\"/></Float64>",
        );
        assert_eq!(names(&model), ["n", "y[1]", "y[2]", "z"], "nobody says 8");
        assert_eq!(model.variables[3].value_type, None);
        model.resize(&[(7, 3)]);
        assert_eq!(names(&model), ["n", "y[1]", "y[2]", "y[3]", "z"]);
        model.resize(&[(7, 0)]);
        assert_eq!(names(&model), ["n", "z"]);
    }

    #[test]
    fn an_array_without_bounds_costs_no_memory() {
        let mut model = model(
            "<UInt64 name=\"n\" valueReference=\"7\" causality=\"structuralParameter\" start=\"2\"/>\
             <Float64 name=\"y\" valueReference=\"1\"><Dimension valueReference=\"7\"/>\
             <Dimension valueReference=\"7\"/></Float64>\
             <Float64 name=\"image\" valueReference=\"2\"><Dimension start=\"400\"/><Dimension start=\"400\"/></Float64>",
        );
        model.resize(&[(7, u64::MAX)]);
        assert_eq!(names(&model), ["n", "y", "image"]);
        assert_eq!(model.variables[2].type_name, "array of Float64");
    }
}
